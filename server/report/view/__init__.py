"""View models of an analysis: tables, checks, headline, quality."""
