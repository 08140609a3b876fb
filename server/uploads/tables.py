"""Uploaded tables of unknown format: guessed and user-defined mappings.

    list_tables(c, blobs, sid)                  # by shape: columns, first rows, guessed or defined mapping
    check_table(c, blobs, sid, name, source)    # are gravity and angular rates plausible with this mapping?
    map_tables(c, actor, sid, names, source)    # add the entry of each file to the manifest
    find_known(c, blobs, sid)                   # shapes with an earlier mapping that fits

A shape is known if the manifest of an earlier recording of the clinic describes a file with the same columns;
its mapping serves as the template. Only two megabytes of each file are read, without verifying its hash; the
analysis verifies it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, cast

from sqlalchemy import Connection, select

from sagittal.core.errors import InputError
from sagittal.server import audit
from sagittal.server.errors import NotFound
from sagittal.server.storage.files.blobs import BlobStore
from sagittal.server.storage.schema.tables import recording
from sagittal.server.uploads import recordings
from sagittal.server.uploads.recordings import StoredRecording

if TYPE_CHECKING:
    from sagittal.core.formats.source import SourceFile
    from sagittal.core.formats.table_guess import TableLook

MOST_EARLIER: Final = 200
"""Earlier recordings searched for a table of the same shape, newest first."""


@dataclass(frozen=True)
class TableShape:
    """Tables with the same columns.

    Parameters
    ----------
    files : file names. names : column names. rows : the first rows of the first file.
    source : entry of the manifest's `sources` without `file`; unknown parts are omitted.
    basis : "said" (in this recording), "known" (in an earlier one), "guessed".
    """

    files: tuple[str, ...]
    names: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    source: Mapping[str, Any]
    basis: str


@dataclass(frozen=True)
class TableReading:
    """Values of a sensor when its table is read with a given mapping.

    Parameters
    ----------
    rate_hz : samples per second. at_rest_mps2 : acceleration in its quietest second, None = never still.
    fastest_radps : high quantile of the angular rate. problems : implausible results, as sentences.
    """

    sensor: str
    rate_hz: float
    at_rest_mps2: float | None
    fastest_radps: float | None
    problems: tuple[str, ...]


def list_tables(c: Connection, blobs: BlobStore, session_id: str) -> tuple[TableShape, ...]:
    """Tables of the current recording by shape; raises NotFound, Conflict no_files."""
    this = recordings.require_current(c, session_id)
    shapes: list[TableShape] = []
    for name, look, entry in _tables(this, blobs):
        mapping = None if entry is None else _as_template(entry, look)
        for i, shape in enumerate(shapes):
            if shape.names == look.names and (shape.basis == "said") == (mapping is not None):
                shapes[i] = replace(shape, files=(*shape.files, name))
                break
        else:
            template = None if mapping else _recall(c, blobs, this, look)
            source = mapping or template or dict(look.source)
            basis = "said" if mapping else "known" if template else "guessed"
            shapes.append(TableShape((name,), look.names, look.rows, source, basis))
    return tuple(shapes)


def check_table(
    c: Connection, blobs: BlobStore, session_id: str, name: str, source: Mapping[str, Any]
) -> tuple[TableReading, ...]:
    """Read the beginning of a file with `source`; raises NotFound, FormatError, ManifestError."""
    this = recordings.require_current(c, session_id)
    file = next((f for f in _files(this, blobs) if f.name == name), None)
    if file is None:
        raise NotFound("file", name)
    return _check(file, source)


def map_tables(
    c: Connection,
    actor: audit.Actor | None,
    session_id: str,
    names: Sequence[str],
    source: Mapping[str, Any],
) -> StoredRecording:
    """Add tables of one shape to the manifest; raises NotFound, ManifestError, Conflict no_files."""
    from sagittal.core.formats.table_guess import make_entry  # slow import

    this = recordings.require_current(c, session_id)
    missing = set(names) - {f.name for f in this.files}
    if missing:
        raise NotFound("file", min(missing))
    manifest = dict(this.manifest or {})
    remaining = [s for s in manifest.get("sources") or () if s["file"] not in names]
    manifest["sources"] = [*(make_entry(source, name) for name in names), *remaining]
    return recordings.set_manifest(c, actor, session_id, manifest)


def find_known(c: Connection, blobs: BlobStore, session_id: str) -> tuple[TableShape, ...]:
    """Tables of a known shape with plausible gravity and angular rates; raises like `list_tables`."""
    return tuple(
        shape
        for shape in list_tables(c, blobs, session_id)
        if shape.basis == "known"
        and all(_fits(c, blobs, session_id, name, shape.source) for name in shape.files)
    )


def _fits(c: Connection, blobs: BlobStore, session_id: str, name: str, source: Mapping[str, Any]) -> bool:
    try:
        return not any(check.problems for check in check_table(c, blobs, session_id, name, source))
    except InputError:
        return False


def _check(file: SourceFile, source: Mapping[str, Any]) -> tuple[TableReading, ...]:
    from sagittal.core.formats.common_time import finish  # slow imports
    from sagittal.core.formats.manifest import manifest_of
    from sagittal.core.formats.table_guess import make_entry, read_sample
    from sagittal.core.quality.signals import measure_signal
    from sagittal.core.quality.suspicion import list_suspicions

    (spec,) = manifest_of({"sources": [make_entry(source, file.name)]}).sources
    checks = []
    for device, stream in finish(read_sample(file, spec)).items():
        facts = measure_signal(stream.acc, stream.gyr, stream.rate_hz)
        notices = [*stream.notices, *list_suspicions(device, facts, stream.acc, stream.quat)]
        checks.append(
            TableReading(
                device,
                round(stream.rate_hz, 3),
                round(facts.still_norm, 3) if facts.still else None,
                None if facts.gyro_top is None else round(facts.gyro_top, 3),
                tuple(n.message for n in notices if n.severity != "info"),
            )
        )
    return tuple(checks)


def _files(this: StoredRecording, blobs: BlobStore) -> Iterator[SourceFile]:
    from sagittal.server.storage.files.blob_source import open_source  # slow import

    for f in this.files:
        yield open_source(blobs, this.patient_id, f.name, f.size, f.sha256)


def _tables(
    this: StoredRecording, blobs: BlobStore
) -> Iterator[tuple[str, TableLook, Mapping[str, Any] | None]]:
    """Name of every table, its structure, and its entry in the manifest."""
    from sagittal.core.formats import bids  # slow imports
    from sagittal.core.formats.manifest import manifest_of
    from sagittal.core.formats.table_guess import look_into_table

    entries = [s for m in (this.manifest or {}, *_uploaded(this, blobs)) for s in m.get("sources") or ()]
    entries = [s for s in entries if s.get("columns")]
    specs = manifest_of({"sources": entries}).sources
    names = {f.name for f in this.files}
    for file in _files(this, blobs):
        if bids.is_table(file.name) and bids.find_parts(file.name)[0] in names:
            continue
        look = look_into_table(file)
        if look is None or not look.source["columns"]:
            continue
        entry = next((e for e, s in zip(entries, specs, strict=True) if s.covers(file.name)), None)
        yield file.name, look, entry


def _uploaded(this: StoredRecording, blobs: BlobStore) -> Iterator[dict[str, Any]]:
    """Readable manifests among the files."""
    from sagittal.core.formats.json_tree import read_json  # slow imports
    from sagittal.core.formats.manifest import MAX_BYTES, is_manifest, manifest_of

    for file in _files(this, blobs):
        if file.name.lower().endswith(".json") and file.size < MAX_BYTES:
            with suppress(InputError, ValueError):
                tree = read_json(file.read())
                if is_manifest(tree):
                    manifest_of(tree)
                    yield cast("dict[str, Any]", tree)


def _recall(c: Connection, blobs: BlobStore, this: StoredRecording, look: TableLook) -> dict[str, Any] | None:
    """Latest mapping in this clinic of a table with these columns, at the rate given by this one."""
    rows = c.execute(
        select(recording.c.id, recording.c.manifest)
        .where(recording.c.manifest.is_not(None), recording.c.id != this.id)
        .order_by(recording.c.created_at.desc(), recording.c.id)
        .limit(MOST_EARLIER)
    )
    for row in rows:
        for entry in (row.manifest or {}).get("sources") or ():
            columns = entry.get("columns") or {}
            used = {name for group in columns.values() for kind in group.values() for name in kind or ()}
            if not used or not used <= set(look.names):
                continue
            earlier = recordings.get(c, row.id)
            if not any(
                name == entry["file"] and earlier_look.names == look.names
                for name, earlier_look, _ in _tables(earlier, blobs)
            ):
                continue
            mapping = _as_template(entry, look)
            return mapping | ({"rate_hz": look.source["rate_hz"]} if "rate_hz" in look.source else {})
    return None


def _as_template(entry: Mapping[str, Any], look: TableLook) -> dict[str, Any]:
    """Entry as a template for tables of this shape; a sensor not named by a column is named after its
    file.
    """
    from sagittal.core.formats.table_guess import THE_FILE  # slow import

    template = {k: v for k, v in entry.items() if k != "file"}
    if set(look.source["columns"]) == {THE_FILE} and len(entry["columns"]) == 1:
        template["columns"] = {THE_FILE: next(iter(entry["columns"].values()))}
    return template
