"""Backup, restore, erasure, and integrity checks of stored data."""
