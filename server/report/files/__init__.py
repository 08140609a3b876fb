"""The files an analysis yields, written and read back."""
