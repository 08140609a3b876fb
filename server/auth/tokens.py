"""Random tokens: the browser or the console holds the token, the database only its SHA-256."""

from __future__ import annotations

import hashlib
import secrets

TOKEN_BYTES = 32


def new_token() -> str:
    """Return 32 random bytes as 43 URL-safe characters."""
    return secrets.token_urlsafe(TOKEN_BYTES)


def token_hash(token: str) -> str:
    """Return what the database keeps; a fast hash is enough for 256 random bits."""
    return hashlib.sha256(token.encode()).hexdigest()
