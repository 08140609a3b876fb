"""Stored files: in a folder or in a bucket, opened, moved, discarded."""
