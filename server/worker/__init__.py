"""The worker: claims jobs, has a child process compute them, publishes what came out."""
