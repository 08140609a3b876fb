"""Who is asking, from where, and what that person may do."""
