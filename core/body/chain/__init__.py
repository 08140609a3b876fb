"""The leg as a chain of hinges on a foot that stands still (docs/science/squat.md)."""
