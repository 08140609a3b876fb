"""Use cases shared by API, pages, CLI and jobs."""
