"""Routes for exports, archives and studies."""
