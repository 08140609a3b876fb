"""Several web servers on one PostgreSQL database: who they are, whose a request is, and the way to them."""
