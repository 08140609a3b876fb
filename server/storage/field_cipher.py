"""Encryption of single values with AES-256-GCM, bound to row and field, using a key file.

    make_keys(path)                                   # once, explicitly; reading never creates one
    keys = read_keys(path)
    sealed = keys.seal("Erika Muster", row_id, "name")
    keys.open(sealed, row_id, "name")                 # for another row or field: ValueUnreadable

A file contains one key, or two during a key change, the new one first. An encrypted value names its key and
hides the length of the text up to multiples of 64 bytes.
"""

from __future__ import annotations

import hashlib
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESGCM

from sagittal.core.errors import SagittalError
from sagittal.core.message import Message
from sagittal.server.storage import fs

_LINE: Final = re.compile(r"SAGITTAL-FIELD-KEY-1 ([0-9a-f]{64})")
_VERSION: Final = b"\x01"
_NAME_BYTES, _NONCE_BYTES, _TAG_BYTES, _STEP = 8, 12, 16, 64
_HEAD: Final = len(_VERSION) + _NAME_BYTES + _NONCE_BYTES


class KeyUnusable(SagittalError):  # noqa: N818 - what is the matter with the key
    """The key of encrypted values is missing or invalid; the message contains a remedy."""

    status = 503


class ValueUnreadable(SagittalError):  # noqa: N818 - what is the matter with the value
    """A value was encrypted with another key, was modified, or belongs to another row or field."""

    status = 503


@dataclass(frozen=True)
class FieldKeys:
    """Keys by their names of 8 bytes; the first one encrypts, all of them decrypt."""

    keys: dict[bytes, bytes] = field(repr=False)

    @property
    def name(self) -> str:
        """Name of the encrypting key, 16 hex digits."""
        return next(iter(self.keys)).hex()

    def has(self, name: str) -> bool:
        """Whether a key is included."""
        return bytes.fromhex(name) in self.keys

    def only(self, name: str) -> FieldKeys:
        """A single key of the set."""
        key_name = bytes.fromhex(name)
        return FieldKeys({key_name: self.keys[key_name]})

    def seal(self, text: str, row_id: str, name: str) -> bytes:
        """Encrypt a text without NUL for one field of one row."""
        key_name, key = next(iter(self.keys.items()))
        plain = text.encode()
        plain += bytes(-len(plain) % _STEP)
        nonce = os.urandom(_NONCE_BYTES)
        return _VERSION + key_name + nonce + AESGCM(key).encrypt(nonce, plain, _bind(row_id, name))

    def open(self, sealed: bytes, row_id: str, name: str) -> str:
        """Decrypt a value of this field and row; raises ValueUnreadable."""
        key_name, nonce = sealed[1 : 1 + _NAME_BYTES], sealed[1 + _NAME_BYTES : _HEAD]
        if sealed[:1] != _VERSION or len(sealed) < _HEAD + _TAG_BYTES:
            raise ValueUnreadable(
                "identity_damaged", Message("The {name} is damaged. {MEND}", name=say_field(name), MEND=_MEND)
            )
        key = self.keys.get(key_name)
        if key is None:
            raise ValueUnreadable(
                "identity_key_wrong",
                Message(
                    "The {name} was encrypted with key {hex}, which is not the installed one. The "
                    "administrator must restore the right key file.",
                    name=say_field(name),
                    hex=key_name.hex(),
                ),
            )
        try:
            return AESGCM(key).decrypt(nonce, sealed[_HEAD:], _bind(row_id, name)).rstrip(b"\0").decode()
        except InvalidTag as error:
            raise ValueUnreadable(
                "identity_damaged",
                Message(
                    "The {name} was changed, or belongs to another patient. {MEND}",
                    name=say_field(name),
                    MEND=_MEND,
                ),
            ) from error


def make_keys(path: Path) -> str:
    """Write a file with a new key, readable by its owner only; return its name; KeyUnusable if it exists."""
    if path.exists():
        raise KeyUnusable(
            "identity_key_exists",
            Message("{path} exists; an existing key is never overwritten.", path=path),
        )
    key = os.urandom(32)
    _write(path, [key])
    return _name(key).hex()


def add_key(path: Path) -> None:
    """Add a new key to a file, which encrypts from now on. Raises KeyUnusable."""
    # follow a link to the actual key file
    _write(path.resolve(), [os.urandom(32), *read_keys(path).keys.values()])


def drop_other_keys(path: Path, name: str) -> None:
    """Remove all keys of a file except one; raises KeyUnusable."""
    _write(path.resolve(), list(read_keys(path).only(name).keys.values()))


def read_keys(path: Path) -> FieldKeys:
    """Read the keys of a file; raises KeyUnusable if it is missing or invalid."""
    try:
        lines = [line.strip() for line in path.read_text("ascii").splitlines()]
    except FileNotFoundError as error:
        raise KeyUnusable(
            "identity_key_missing",
            "The encryption key of patient names is missing. The administrator must restore the file.",
        ) from error
    except (OSError, UnicodeDecodeError) as error:
        raise KeyUnusable(
            "identity_key_missing",
            "The encryption key of patient names cannot be read. The administrator must repair it.",
        ) from error
    matches = [_LINE.fullmatch(line) for line in lines if line and not line.startswith("#")]
    keys = [bytes.fromhex(one[1]) for one in matches if one is not None]
    if not keys or len(keys) != len(matches):
        raise KeyUnusable(
            "identity_key_wrong",
            "The key file of patient names does not contain this key. The administrator must restore the "
            "right one.",
        )
    return FieldKeys({_name(key): key for key in keys})


_MEND: Final = "The administrator should run `sagittal check` and restore it from a backup or from paper."


def say_field(name: str) -> str:
    """Name of a field for use in a sentence."""
    return {"born_on": "date of birth", "contact": "address and telephone"}.get(name, name.replace("_", " "))


def _bind(row_id: str, name: str) -> bytes:
    return f"sagittal field 1\0{row_id}\0{name}".encode()


def _name(key: bytes) -> bytes:
    return hashlib.sha256(b"sagittal field key 1" + key).digest()[:_NAME_BYTES]


def _write(path: Path, keys: list[bytes]) -> None:
    lines = [f"SAGITTAL-FIELD-KEY-1 {key.hex()}" for key in keys]
    note = (
        "# opens names and addresses of patients (sagittal identity-key); keep a copy away from the backups"
    )
    fs.write_file(path, "\n".join([note, *lines, ""]).encode())
