"""Server-made HTML over the same services as the API: one file a page; changes go through the API itself."""
