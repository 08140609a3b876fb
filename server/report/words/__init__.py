"""How figures, findings and devices are named in sentences."""
