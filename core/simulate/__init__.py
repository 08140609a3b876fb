"""Simulated walkers and sensors with exact truth, for tests, demo and CLI."""
