"""Database, tables, blobs, and the only module that opens files for writing."""
