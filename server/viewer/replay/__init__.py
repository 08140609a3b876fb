"""Avatar of a recorded walk."""
