"""Parameters over a patient's visits: trends, comparisons, and the leaflet."""
