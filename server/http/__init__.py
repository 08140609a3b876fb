"""HTTP middleware and responses: guards, limits, headers, compression and problem details."""
