"""Downloads: exports, archives, studies, de-identified data, and all data of a patient."""
