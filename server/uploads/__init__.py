"""What comes in as files: recordings, tables, videos, references."""
