"""Passwords, login sessions, roles, CSRF."""
