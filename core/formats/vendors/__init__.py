"""Vendor file formats: one module each, listed in registry."""
