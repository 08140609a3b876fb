"""Charts as SVG: curves, bars, dots, for page and paper."""
