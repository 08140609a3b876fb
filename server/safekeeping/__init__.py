"""Backup, restore, erasure, and checks that what is stored is still there."""
