"""Database, tables, blobs, the folder of compiled filters; the only module that opens files for writing."""
