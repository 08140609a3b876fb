"""Wording of parameters, findings and devices in sentences."""
