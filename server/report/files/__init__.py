"""Result files of an analysis: writers and readers."""
