"""Pages of signed reports and access to them."""
