"""The figure of a recorded walk."""
