"""Patient identities: name, date of birth, record numbers and contact, encrypted and linked to the pseudonym.

Disabled until the operator creates a key (`sagittal identity-key make`). The key is a file outside the
database; if identities exist, a missing key is an error and never replaced. The database records which key
encrypts, so that of several computers none uses a different key. Names cannot be searched: an index that
finds a name without decrypting every row would reveal to anyone with the database which rows are equal.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Connection, delete, insert, select, update

from sagittal.core.errors import SagittalError
from sagittal.core.message import Message
from sagittal.core.user_text import UserText
from sagittal.server import audit
from sagittal.server.clinic import patients
from sagittal.server.errors import Conflict, ServiceError
from sagittal.server.storage.db import Database
from sagittal.server.storage.field_cipher import (
    FieldKeys,
    KeyUnusable,
    add_key,
    drop_other_keys,
    make_keys,
    read_keys,
    say_field,
)
from sagittal.server.storage.schema.person_tables import identity_key, patient_identity
from sagittal.server.storage.schema.tables import now

FIELDS: Final = ("name", "born_on", "record_number", "insurance_number", "contact")
MOST: Final[Mapping[str, int]] = {
    "name": 200,
    "record_number": 64,
    "insurance_number": 64,
    "contact": 1000,
}
"""Maximum number of characters."""
OLDEST: Final = dt.date(1850, 1, 1)


@dataclass(frozen=True)
class PatientIdentity:
    """Identity of a patient as far as recorded; values are excluded from the repr, which may be logged.

    Parameters
    ----------
    record_number : of the clinic's records. contact : address, telephone, relatives; lines of text.
    changed_at : None = nothing recorded.
    """

    name: str | None = field(default=None, repr=False)
    born_on: dt.date | None = field(default=None, repr=False)
    record_number: str | None = field(default=None, repr=False)
    insurance_number: str | None = field(default=None, repr=False)
    contact: str | None = field(default=None, repr=False)
    changed_at: dt.datetime | None = None


def are_kept(c: Connection, key_file: Path) -> bool:
    """Whether this clinic stores identities: a key exists, or has been used and is missing."""
    return _is_there(key_file) or _find_sealing(c) is not None


def get(c: Connection, key_file: Path, patient_id: str) -> PatientIdentity:
    """Identity of a patient, empty if none is recorded.

    Raises
    ------
    NotFound; Conflict `identities_off`; KeyUnusable, ValueUnreadable
        the key, or a row, cannot be used.
    """
    patients.get(c, patient_id)
    keys = _read_keys(c, key_file)
    row = c.execute(select(patient_identity).where(patient_identity.c.patient_id == patient_id)).first()
    return PatientIdentity() if row is None else _open(keys, row._asdict())


def change(
    c: Connection, key_file: Path, actor: audit.Actor | None, patient_id: str, values: Mapping[str, object]
) -> PatientIdentity:
    """Update some of FIELDS, None or empty = cleared; raises as `get`, ServiceError bad_value.

    The key is read in the writing transaction, so that it cannot be changed in between.
    """
    previous = get(c, key_file, patient_id)
    checked = {name: _check(name, value) for name, value in values.items()}
    changed = sorted(name for name, value in checked.items() if getattr(previous, name) != value)
    if not changed:
        return previous
    updated = {name: checked.get(name, getattr(previous, name)) for name in FIELDS}
    mine = patient_identity.c.patient_id == patient_id
    c.execute(delete(patient_identity).where(mine))
    if any(value is not None for value in updated.values()):
        sealed = _seal(_read_sealing(c, key_file), patient_id, updated)
        c.execute(insert(patient_identity).values(patient_id=patient_id, changed_at=now(), **sealed))
    audit.record(c, actor, "identity.changed", "patient", patient_id, {"fields": changed})
    return get(c, key_file, patient_id)


def make_key(db: Database, key_file: Path) -> str:
    """Enable identities: create a key and return its name.

    Raises
    ------
    KeyUnusable
        a key exists, here or on another web server, or identities exist whose key is missing.
    """
    with db.write() as c:
        if not _is_there(key_file) and (sealing := _find_sealing(c)) is not None:
            raise KeyUnusable(
                "identity_key_missing",
                Message(
                    "Names are encrypted by key {sealing}, which is not at {key_file}. Put the file "
                    "with it there, as the other web servers have it. If it is lost for good, see "
                    "`sagittal identity-key discard`.",
                    sealing=sealing,
                    key_file=key_file,
                ),
            )
        name = make_keys(key_file)
        _set_sealing(c, name)
        return name


def discard_unreadable(db: Database, key_file: Path, *, really: bool, without_key: bool) -> list[str]:
    """Ids of the patients whose identity the current key cannot decrypt; `really` deletes these rows.

    Parameters
    ----------
    without_key : the key in use is permanently lost: delete all identities and use another key from now on.

    Raises
    ------
    KeyUnusable
        identities would be deleted only because the correct key is missing.
    """
    with db.write() as c:
        if not are_kept(c, key_file):
            return []
        try:
            keys = _read_keys(c, key_file)
        except KeyUnusable as error:
            if really and not without_key:
                raise KeyUnusable(
                    error.code,
                    Message(
                        "{message} Nothing was removed: with the right key at {key_file} all names may be "
                        "readable. Only if it is lost for good, add --without-key.",
                        message=error.message,
                        key_file=key_file,
                    ),
                ) from error
            keys = FieldKeys({})
            if really:
                c.execute(delete(identity_key))
        gone = []
        for row in c.execute(select(patient_identity).order_by(patient_identity.c.patient_id)):
            try:
                _open(keys, row._asdict())
            except SagittalError:
                gone.append(row.patient_id)
        if really:
            for patient_id in gone:
                c.execute(delete(patient_identity).where(patient_identity.c.patient_id == patient_id))
                audit.record(c, None, "identity.discarded", "patient", patient_id)
        return gone


def change_key(db: Database, key_file: Path) -> tuple[str, int]:
    """Re-encrypt all identities with a new key; return its name and the number of rows.

    The file contains both keys until every row has been rewritten, so all rows remain readable; an
    interrupted change is resumed by running it again. The file is written in writing transactions only, which
    serializes concurrent changes.

    Raises
    ------
    KeyUnusable, ValueUnreadable
        nothing was changed.
    """
    with db.write() as c:
        _open_all(c, _read_keys(c, key_file))
        add_key(key_file)
        keys = read_keys(key_file)
        _set_sealing(c, keys.name)
        rows = c.execute(select(patient_identity)).all()
        for row in rows:
            values = _open(keys, row._asdict())
            sealed = _seal(keys, row.patient_id, {name: getattr(values, name) for name in FIELDS})
            mine = patient_identity.c.patient_id == row.patient_id
            c.execute(update(patient_identity).where(mine).values(**sealed))
        audit.record(c, None, "identities.key_changed", "database", None, {"patients": len(rows)})
    with db.write() as c:
        keys = _read_sealing(c, key_file)
        _open_all(c, keys)  # the old key is removed only when it is no longer needed
        drop_other_keys(key_file, keys.name)
        return keys.name, len(rows)


def find_problems(c: Connection, key_file: Path) -> list[str]:
    """One sentence for each identity that cannot be decrypted, or a single one if the key is unusable."""
    if not are_kept(c, key_file):
        return []
    try:
        keys = _read_keys(c, key_file)
    except KeyUnusable as error:
        return [f"{key_file}: {error.message}"]
    problems = []
    for row in c.execute(select(patient_identity).order_by(patient_identity.c.patient_id)):
        try:
            _open(keys, row._asdict())
        except SagittalError as error:
            problems.append(f"patient {row.patient_id}: {error.message}")
    return problems


def _open_all(c: Connection, keys: FieldKeys) -> None:
    for row in c.execute(select(patient_identity)):
        _open(keys, row._asdict())


def _is_there(path: Path) -> bool:
    """Whether a file exists; False also without permission."""
    try:
        return path.is_file()
    except OSError:
        return False


def _find_sealing(c: Connection) -> str | None:
    """Name of the key used for encryption, None before the first use."""
    return c.execute(select(identity_key.c.name)).scalar()


def _set_sealing(c: Connection, name: str) -> None:
    c.execute(delete(identity_key))
    c.execute(insert(identity_key).values(purpose="seal", name=name, since=now()))


def _read_keys(c: Connection, key_file: Path) -> FieldKeys:
    """Keys in the file, which must include the one in use; raises Conflict, KeyUnusable."""
    if not are_kept(c, key_file):
        raise Conflict(
            "identities_off",
            "This clinic does not store names: the administrator must create an encryption key first.",
        )
    keys, sealing = read_keys(key_file), _find_sealing(c)
    if sealing is not None and not keys.has(sealing):
        raise KeyUnusable(
            "identity_key_wrong",
            Message(
                "Names are encrypted with key {sealing}, but the key file on this computer holds {name}. The "
                "administrator must install the right file.",
                sealing=sealing,
                name=keys.name,
            ),
        )
    return keys


def _read_sealing(c: Connection, key_file: Path) -> FieldKeys:
    """The key in use only; requires a writing transaction, since the first use of a key is recorded."""
    keys = _read_keys(c, key_file)
    sealing = _find_sealing(c)
    if sealing is None:
        sealing = keys.name
        _set_sealing(c, sealing)
    return keys.only(sealing)


def _open(keys: FieldKeys, row: Mapping[Any, Any]) -> PatientIdentity:
    texts = {
        name: None if row[name] is None else UserText(keys.open(bytes(row[name]), row["patient_id"], name))
        for name in FIELDS
    }
    born = texts.pop("born_on")
    day = None if born is None else dt.date.fromisoformat(born)
    return PatientIdentity(born_on=day, changed_at=row["changed_at"], **texts)


def _seal(keys: FieldKeys, patient_id: str, values: Mapping[str, object]) -> dict[str, bytes | None]:
    # str() of a day is its ISO form
    return {
        name: None if value is None else keys.seal(str(value), patient_id, name)
        for name, value in values.items()
    }


def _check(name: str, value: object) -> object:
    """Validate a value; error messages may be logged and do not contain it."""
    if name not in FIELDS:
        raise ServiceError("bad_value", "An identity has no such field.")
    if name == "born_on":
        # tomorrow may be today in another time zone
        if isinstance(value, dt.date) and not OLDEST <= value <= now().date() + dt.timedelta(days=1):
            raise ServiceError("bad_value", "The date of birth is expected from 1850 to today.")
        return value
    text = "" if value is None else str(value).strip()
    if len(text) > MOST[name] or "\0" in text:
        raise ServiceError(
            "bad_value",
            Message("The {name} has at most {name2} characters.", name=say_field(name), name2=MOST[name]),
        )
    return text or None
