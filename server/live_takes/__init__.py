"""Live trials: opening, logging, feedback, video, and conversion to recordings."""
