"""Who may read results: signed reports, links to them, care teams, PDFs."""
