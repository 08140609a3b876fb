"""Live takes: the tablet's stream onto the disk, the estimate beside it, the browsers that watch."""
