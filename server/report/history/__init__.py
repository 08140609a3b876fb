"""Figures over the visits of a person: trends, comparisons, the leaflet."""
