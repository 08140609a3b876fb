"""Commands of science: simulate, study, bench, tune, stairs, sensitivity."""
