"""Routes of exports, archives and studies."""
