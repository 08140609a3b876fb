"""Database, tables, blobs, compiled filters, and the only module that opens files for writing."""
