"""All stored data of one patient as one zip, for the patient or another clinic.

    for piece in export_patient(db, blobs, patient_id, key_file): ...        # streamed

`patient.json` has every row that belongs to the patient, by table, with the authors' names; the identity is
included in clear text if the user may read it, otherwise omitted. `audit.json` lists access and changes,
`files/<table>/<id>/<name>` are the files, recordings as uploaded. Rows of a patient are found through foreign
keys, so new tables are included automatically.
"""

from __future__ import annotations

import datetime as dt
import json
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sqlalchemy import Connection, Table, or_, select

from sagittal.server.clinic import identities, patients
from sagittal.server.export.zipping import ZipSink
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.storage.archive import PIECE
from sagittal.server.storage.db import Database
from sagittal.server.storage.field_cipher import KeyUnusable, ValueUnreadable
from sagittal.server.storage.files.blobs import BlobStore, IntegrityError
from sagittal.server.storage.schema.person_tables import patient_identity
from sagittal.server.storage.schema.tables import audit, metadata, now, patient, user

_INTO: Final = "w"
"""How an entry of the zip is opened; nothing is written to disk."""
SECRET: Final = frozenset({"code_sha256", "token_sha256"})
"""Columns with credentials, which are not patient data."""
_ENCRYPTED: Final = patient_identity.name


@dataclass(frozen=True)
class ExportedFile:
    """A stored file and its name in the zip."""

    name: str
    sha256: str


def list_rows(c: Connection, patient_id: str) -> dict[str, list[dict[str, Any]]]:
    """All rows that belong to a patient, by table; raises NotFound."""
    patients.get(c, patient_id)
    rows_by_table: dict[str, dict[tuple[object, ...], dict[str, Any]]] = {}
    ids: dict[str, set[str]] = {patient.name: {patient_id}}
    _keep(c, patient, patient.c.id == patient_id, rows_by_table, ids)
    grows = True
    while grows:
        grows = False
        for table in metadata.sorted_tables:
            # the author of a row is not the patient it is about
            keys = [key for key in table.foreign_keys if key.column.table.name in ids.keys() - {user.name}]
            if keys and table.name != _ENCRYPTED:
                mine = or_(*(key.parent.in_(ids[key.column.table.name]) for key in keys))
                grows = _keep(c, table, mine, rows_by_table, ids) or grows
    return {name: list(rows.values()) for name, rows in sorted(rows_by_table.items())}


def list_files(rows: dict[str, list[dict[str, Any]]]) -> list[ExportedFile]:
    """Files referenced by rows; their names were validated on upload (receiving.check_name)."""
    files = {}
    for table, its_rows in rows.items():
        for row in its_rows:
            for name, sha256 in (("name", "sha256"), ("reference_name", "reference_sha256")):
                if row.get(name) and row.get(sha256):
                    owner = next(str(value) for key, value in row.items() if key.endswith("id"))
                    path = f"files/{table}/{owner}/{row[name]}"
                    files[path] = ExportedFile(path, row[sha256])
    return list(files.values())


def export_patient(
    db: Database, blobs: BlobStore, patient_id: str, identity_key: Path | None = None
) -> Iterator[bytes]:
    """Yield the zip in parts; missing or damaged files are listed in `missing.json` instead.

    Parameters
    ----------
    identity_key : file with the key of identities; None = the user may not read identities.
    """
    missing = []
    with db.read() as c:
        rows = list_rows(c, patient_id)
        if identity_key is not None and identities.are_kept(c, identity_key):
            try:
                identity = identities.get(c, identity_key, patient_id)
            except (KeyUnusable, ValueUnreadable) as error:
                missing.append({"name": _ENCRYPTED, "why": error.message})
            else:
                if identity.changed_at is not None:
                    rows[_ENCRYPTED] = [{k: _plain(v) for k, v in vars(identity).items()}]
        ids = [row["id"] for its_rows in rows.values() for row in its_rows if "id" in row]
        trail = c.execute(select(audit).where(audit.c.resource_id.in_(ids)).order_by(audit.c.seq)).all()
        people = c.execute(select(user.c.id, user.c.name)).all()
    return _zip(blobs, patient_id, rows, [row._asdict() for row in trail], dict(map(tuple, people)), missing)


def _zip(
    blobs: BlobStore,
    patient_id: str,
    rows: dict[str, list[dict[str, Any]]],
    trail: list[dict[str, Any]],
    people: dict[str, str],
    missing: list[dict[str, str]],
) -> Iterator[bytes]:
    sink = ZipSink()
    # stored uncompressed: recordings hardly shrink, and the server has other requests to serve
    with zipfile.ZipFile(sink, "w", zipfile.ZIP_STORED) as archive:
        text = json.dumps(rows, ensure_ascii=False)
        named = {one: name for one, name in people.items() if one in text}
        about = {"exported_at": now(), "code_version": CODE_VERSION, "users": named, "rows": rows}
        archive.writestr("patient.json", _dump(about))
        archive.writestr("audit.json", _dump(trail))
        yield sink.take()
        for file in list_files(rows):
            try:
                source = blobs.open(patient_id, file.sha256)
            except IntegrityError as error:
                missing.append({"name": file.name, "why": error.message})
                continue
            with source, archive.open(file.name, _INTO, force_zip64=True) as target:
                while piece := source.read(PIECE):
                    target.write(piece)
                    yield sink.take()
        if missing:
            archive.writestr("missing.json", _dump(missing))
    yield sink.take()


def _keep(
    c: Connection,
    table: Table,
    mine: Any,
    tables: dict[str, dict[tuple[object, ...], dict[str, Any]]],
    ids: dict[str, set[str]],
) -> bool:
    """Add rows of a table to the result; return whether any are new."""
    rows = tables.setdefault(table.name, {})
    count = len(rows)
    for row in c.execute(select(table).where(mine)):
        values = {name: _plain(value) for name, value in row._asdict().items() if name not in SECRET}
        rows[tuple(getattr(row, column.name) for column in table.primary_key)] = values
        if "id" in values:
            ids.setdefault(table.name, set()).add(str(values["id"]))
    if not rows:
        del tables[table.name]
    return len(rows) > count


def _plain(value: object) -> object:
    return value.isoformat() if isinstance(value, dt.date) else value


def _dump(tree: object) -> str:
    return json.dumps(tree, ensure_ascii=False, indent=1, default=_plain)
