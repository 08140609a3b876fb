"""Bytes → Recording: one vendor per file, detection by content, never by file name."""
