"""SVG charts for pages and print: curves, bars, dots."""
