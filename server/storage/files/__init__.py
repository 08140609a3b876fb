"""Stored files in a folder or a bucket: open, move, discard."""
