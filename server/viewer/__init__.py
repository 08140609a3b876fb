"""3D views: poses to viser scenes, one server per view, accessible through our proxy."""
