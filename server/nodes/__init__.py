"""Several web servers on one PostgreSQL database: registry, ownership of requests, and forwarding."""
