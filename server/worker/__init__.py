"""Worker: claims jobs, computes them in a child process and publishes the results."""
