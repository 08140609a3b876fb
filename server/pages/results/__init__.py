"""Pages of analyses and their results."""
