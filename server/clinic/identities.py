"""Who a patient is: name, date of birth, numbers and contact beside the pseudonym, each value encrypted.

Off until the operator makes a key (`sagittal identity-key make`). The key is a file outside the database; a
key that is missing beside names that are there is an error, never a new key. The database knows which key
seals, so that of several computers none seals by a file of its own. There is no search by name:
what would find a name without opening every row would tell whoever has the database which rows are alike.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Connection, delete, insert, select, update

from sagittal.core.errors import SagittalError
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
"""Characters at most."""
OLDEST: Final = dt.date(1850, 1, 1)


@dataclass(frozen=True)
class PatientIdentity:
    """Who a patient is, as far as it was written down; no value is part of its repr, which may be logged.

    Parameters
    ----------
    record_number : of the clinic's own records. contact : address, telephone, relatives; lines of text.
    changed_at : None = nothing is written down.
    """

    name: str | None = field(default=None, repr=False)
    born_on: dt.date | None = field(default=None, repr=False)
    record_number: str | None = field(default=None, repr=False)
    insurance_number: str | None = field(default=None, repr=False)
    contact: str | None = field(default=None, repr=False)
    changed_at: dt.datetime | None = None


def are_kept(c: Connection, key_file: Path) -> bool:
    """Whether this clinic keeps names: there is a key, or one that sealed and is missing."""
    return _is_there(key_file) or _find_sealing(c) is not None


def get(c: Connection, key_file: Path, patient_id: str) -> PatientIdentity:
    """Who a patient is, empty where nothing is written down.

    Raises
    ------
    NotFound; Conflict `identities_off`; KeyUnusable, ValueUnreadable
        of the key, of a row.
    """
    patients.get(c, patient_id)
    keys = _read_keys(c, key_file)
    row = c.execute(select(patient_identity).where(patient_identity.c.patient_id == patient_id)).first()
    return PatientIdentity() if row is None else _open(keys, row._asdict())


def change(
    c: Connection, key_file: Path, actor: audit.Actor | None, patient_id: str, values: Mapping[str, object]
) -> PatientIdentity:
    """Change some of FIELDS, None or empty = no longer written down; raises as `get`, ServiceError bad_value.

    The key is read in the writing transaction: a change of keys cannot pass in between.
    """
    before = get(c, key_file, patient_id)
    checked = {name: _check(name, value) for name, value in values.items()}
    changed = sorted(name for name, value in checked.items() if getattr(before, name) != value)
    if not changed:
        return before
    after = {name: checked.get(name, getattr(before, name)) for name in FIELDS}
    mine = patient_identity.c.patient_id == patient_id
    c.execute(delete(patient_identity).where(mine))
    if any(value is not None for value in after.values()):
        sealed = _seal(_read_sealing(c, key_file), patient_id, after)
        c.execute(insert(patient_identity).values(patient_id=patient_id, changed_at=now(), **sealed))
    audit.record(c, actor, "identity.changed", "patient", patient_id, {"fields": changed})
    return get(c, key_file, patient_id)


def make_key(db: Database, key_file: Path) -> str:
    """Begin to keep names: make a key and return its name.

    Raises
    ------
    KeyUnusable
        there is one, here or at another web server, or names are stored whose key is missing.
    """
    with db.write() as c:
        if not _is_there(key_file) and (sealing := _find_sealing(c)) is not None:
            raise KeyUnusable(
                "identity_key_missing",
                f"Names are encrypted by key {sealing}, which is not at {key_file}. Put the file with it "
                "there, as the other web servers have it. If it is lost for good, see `sagittal identity-key "
                "discard`.",
            )
        name = make_keys(key_file)
        _set_sealing(c, name)
        return name


def discard_unreadable(db: Database, key_file: Path, *, really: bool, without_key: bool) -> list[str]:
    """Ids of the patients whose identity the key in its place does not open; `really` removes these rows.

    Parameters
    ----------
    without_key : the key that sealed is lost for good: remove all names, another key seals from now on.

    Raises
    ------
    KeyUnusable
        something would be removed only because the right key is not in its place.
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
                    f"{error.message} Nothing was removed: with the right key at {key_file} all names may be "
                    "readable. Only if it is lost for good, add --without-key.",
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
    """Encrypt everything by a new key; returns its name and how many rows. Stopped midway, run it again.

    The file holds both keys until every row is written anew, so all can be read at any moment. It is written
    in writing transactions only: who changes the key at the same time comes before or after.

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
        _open_all(c, keys)  # the old one goes only when nothing needs it
        drop_other_keys(key_file, keys.name)
        return keys.name, len(rows)


def find_problems(c: Connection, key_file: Path) -> list[str]:
    """Whose identity cannot be read and why, one sentence each; one alone where the key is not usable."""
    if not are_kept(c, key_file):
        return []
    try:
        keys = _read_keys(c, key_file)
    except KeyUnusable as error:
        return [f"{key_file}: {error.message}"]
    found = []
    for row in c.execute(select(patient_identity).order_by(patient_identity.c.patient_id)):
        try:
            _open(keys, row._asdict())
        except SagittalError as error:
            found.append(f"patient {row.patient_id}: {error.message}")
    return found


def _open_all(c: Connection, keys: FieldKeys) -> None:
    for row in c.execute(select(patient_identity)):
        _open(keys, row._asdict())


def _is_there(path: Path) -> bool:
    """Whether a file is there; False also where nobody may look."""
    try:
        return path.is_file()
    except OSError:
        return False


def _find_sealing(c: Connection) -> str | None:
    """Name of the key that seals, None before one is used."""
    return c.execute(select(identity_key.c.name)).scalar()


def _set_sealing(c: Connection, name: str) -> None:
    c.execute(delete(identity_key))
    c.execute(insert(identity_key).values(purpose="seal", name=name, since=now()))


def _read_keys(c: Connection, key_file: Path) -> FieldKeys:
    """The keys of the file, which the one that seals must be among; raises Conflict, KeyUnusable."""
    if not are_kept(c, key_file):
        raise Conflict(
            "identities_off", "This clinic keeps no names: the operator makes a key for them first."
        )
    keys, sealing = read_keys(key_file), _find_sealing(c)
    if sealing is not None and not keys.has(sealing):
        raise KeyUnusable(
            "identity_key_wrong",
            f"Names are encrypted by key {sealing}; the key file of this computer holds {keys.name}. "
            "The operator puts the right file there.",
        )
    return keys


def _read_sealing(c: Connection, key_file: Path) -> FieldKeys:
    """The key that seals, alone; in a writing transaction, since the first that is used is it from now on."""
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
    """A value as it is stored; what was typed is in no message, which may be logged."""
    if name not in FIELDS:
        raise ServiceError("bad_value", "An identity has no such field.")
    if name == "born_on":
        # a day to come may be today elsewhere on earth
        if isinstance(value, dt.date) and not OLDEST <= value <= now().date() + dt.timedelta(days=1):
            raise ServiceError("bad_value", "The date of birth is expected from 1850 to today.")
        return value
    text = "" if value is None else str(value).strip()
    if len(text) > MOST[name] or "\0" in text:
        raise ServiceError("bad_value", f"The {say_field(name)} has at most {MOST[name]} characters.")
    return text or None
