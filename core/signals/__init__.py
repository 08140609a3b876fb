"""What was recorded, and how signals are filtered, searched and kept in memory."""
