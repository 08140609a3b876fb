"""Live trials: recording of the tablet's stream, real-time estimation, and updates for browsers."""
