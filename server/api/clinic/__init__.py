"""Routes of patients and their visits."""
