"""Routes for signed reports and access to them."""
