"""L7S (Sy 2021): seven segments of a walking person from sensors on pelvis and feet, or on the feet alone."""
