"""Parameters of a walk as it streams."""
