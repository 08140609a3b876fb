"""Database, tables, blobs, the folder of compiled filters, and the only module that opens files for writing."""
