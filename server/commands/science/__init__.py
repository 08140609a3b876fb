"""Scientific commands: simulate, study, bench, tune, stairs, sensitivity."""
