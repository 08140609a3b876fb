"""Constraints that the results of every walk must satisfy; a violated one indicates a wrong result."""
