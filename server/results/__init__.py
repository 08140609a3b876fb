"""Analyses, edits of them, and what is compared, prescribed and read from them."""
