"""Avatar of a live trial."""
