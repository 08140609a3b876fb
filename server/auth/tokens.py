"""Random tokens: the browser or console holds the token, the database only its SHA-256."""

from __future__ import annotations

import hashlib
import secrets

TOKEN_BYTES = 32


def new_token() -> str:
    """Return 32 random bytes as 43 URL-safe characters."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def token_hash(token: str) -> str:
    """Return the hash stored in the database; a fast hash is sufficient for 256 random bits."""
    return hashlib.sha256(token.encode()).hexdigest()
