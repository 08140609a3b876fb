"""Password hashing with argon2id: at most two at a time, in equal time whether or not the account exists."""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Iterator

from pwdlib import PasswordHash
from pwdlib.exceptions import PwdlibError
from pwdlib.hashers.argon2 import Argon2Hasher

from sagittal.core.message import Message
from sagittal.server.http.problems import Problem

MIN_LENGTH = 12  # OWASP ASVS 4.0.3, 2.1.1
MAX_LENGTH = 128  # OWASP ASVS 4.0.3, 2.1.2

# argon2id m=64 MiB, t=3, p=4 (RFC 9106 §4, second recommended option) are the hasher's defaults
_HASHER = PasswordHash((Argon2Hasher(),))
# each hash takes 64 MiB: unbounded, a burst of sign-ins would exhaust memory
_SLOTS = threading.BoundedSemaphore(2)
# and with unlimited waiting it would occupy all threads that serve requests
PATIENCE_S = 5.0


def hash_password(password: str) -> str:
    """Return the argon2id hash of a new password; raise Problem if it is too short or too long."""
    if not MIN_LENGTH <= len(password) <= MAX_LENGTH:
        raise Problem(
            422,
            "weak_password",
            Message(
                "A password needs {MIN_LENGTH} to {MAX_LENGTH} characters; this one has {password}. "
                "A few unrelated words make a good one.",
                MIN_LENGTH=MIN_LENGTH,
                MAX_LENGTH=MAX_LENGTH,
                password=len(password),
            ),
        )
    with _slot():
        return _HASHER.hash(password)


def verify_password(password: str, stored: str | None) -> bool:
    """Whether the password is correct; None (no such account) takes as long as a wrong password."""
    if len(password) > MAX_LENGTH:
        password = ""
    nobody = _nobody()
    with _slot():
        try:
            right = _HASHER.verify(password, stored or nobody)
        except PwdlibError:
            return False
    return right and stored is not None


@functools.cache
def _nobody() -> str:
    """Return the hash that unknown names are checked against, computed at the first sign-in."""
    with _slot():
        return _HASHER.hash("no account has this password")


@contextlib.contextmanager
def _slot() -> Iterator[None]:
    if not _SLOTS.acquire(timeout=PATIENCE_S):
        raise Problem(
            503,
            "busy",
            "Too many people are signing in at the moment. Try again in a few seconds.",
            headers={"Retry-After": "5"},
        )
    try:
        yield
    finally:
        _SLOTS.release()
