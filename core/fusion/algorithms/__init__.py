"""Published orientation filters of one inertial sensor, in six engines (docs/science/filters.md)."""
