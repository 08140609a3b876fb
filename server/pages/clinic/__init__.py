"""Pages of patients and their visits."""
