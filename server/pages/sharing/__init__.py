"""Pages of signed reports and who may read them."""
