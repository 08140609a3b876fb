"""The figure of a live take."""
