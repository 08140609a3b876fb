"""Reference tables (package data) and their lookup."""
