"""Routes of analyses and what is read from them."""
