"""Routes for uploads."""
