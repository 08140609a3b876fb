"""Parameters of a walk in real time."""
