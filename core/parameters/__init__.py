"""Strides and angles → parameters and cycle curves."""
