"""Routes of live takes."""
