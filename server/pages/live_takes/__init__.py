"""Pages of live trials."""
