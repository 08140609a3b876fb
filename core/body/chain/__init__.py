"""The leg as a chain of hinge joints on a stationary foot (docs/science/squat.md)."""
