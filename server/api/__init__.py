"""One router per resource; JSON under /api/v1."""
