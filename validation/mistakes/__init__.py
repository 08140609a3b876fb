"""Mistakes of a clinic in large numbers: which wrong results are reported, repaired, harmless or silent."""
