"""Pages of live takes."""
