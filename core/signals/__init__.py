"""Recordings and signals, and their filtering, peak detection and storage."""
