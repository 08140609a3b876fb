"""3D views: poses to viser scenes, one server per view, behind our proxy."""
