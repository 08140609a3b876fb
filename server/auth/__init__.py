"""Authentication and authorization: identity, network origin and permissions of each request."""
