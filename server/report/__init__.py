"""Presentation of an analysis: degrees, words, curves and export files."""
