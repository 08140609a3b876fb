"""What is taken out: exports, archives, studies, de-identified data, a patient's own data."""
