"""Uploads: recordings, tables, videos, references."""
