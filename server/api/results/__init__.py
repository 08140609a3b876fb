"""Routes for analyses and their results."""
