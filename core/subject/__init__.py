"""The person: lengths, shoes, angles of standing, and the conditions of a walk."""
