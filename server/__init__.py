"""Everything with effects: HTTP, database, files, jobs, 3D views, command line."""
