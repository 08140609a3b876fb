"""Tables and the rules of their rows."""
