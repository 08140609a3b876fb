"""Everything with side effects: HTTP, database, files, jobs, 3D views and command line."""
