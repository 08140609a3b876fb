"""Files of sensor makers: one module each, listed in registry."""
