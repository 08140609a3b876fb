"""Routes for live trials."""
