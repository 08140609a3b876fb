"""Child processes: start, communication and termination."""
