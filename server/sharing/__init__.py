"""Sharing of results: signed reports, links to them, care teams, PDFs."""
