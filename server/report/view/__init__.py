"""An analysis as one page shows it: tables, checks, headline, quality."""
