"""Archive of a visit: one zip with the recording, the manifest and settings of its analysis, and results.

    sagittal-episode.json     version, time, SHA-256 of every file, later edits by users
    recording/…               the original files, unpacked from zip and gz
    sagittal-manifest.json    the manifest of the analysis
    config.json               settings that differ from the defaults
    results/…                 result files as stored
    report/…                  parameters and curves of the report, including edits; the signed report
                              in force, with its PDF if available

Uploaded to another Sagittal, or given to `sagittal analyse`, the recording is read with that manifest and
those settings, so the same version gives the same numbers.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Iterator, Mapping
from typing import IO, Any, Final

from sagittal.core.errors import InputError
from sagittal.server.export.zipping import EARLIEST
from sagittal.server.provenance import CODE_VERSION
from sagittal.server.results.analyses import AnalysisRecord
from sagittal.server.results.edit_log import EditHistory
from sagittal.server.sharing.signed_reports import SignedDocuments
from sagittal.server.storage.files.blobs import BlobStore
from sagittal.server.uploads.recordings import StoredRecording

SCHEMA: Final = 1
_PACKED: Final = (".parquet", ".gz", ".h5", ".pdf")
_LEVEL: Final = 1
"""Deflate level: text compresses four to one quickly, and hardly better in ten times the time."""


def write_archive(
    out: IO[bytes],
    blobs: BlobStore,
    recording: StoredRecording,
    record: AnalysisRecord,
    edits: EditHistory,
    report: Mapping[str, bytes],
    signed: SignedDocuments | None,
) -> None:
    """Write the archive of an analysis.

    Parameters
    ----------
    recording : the analysed recording. report : files of the report by name. signed : the version in force.

    Raises
    ------
    IntegrityError, ArchiveError
        A stored file or an uploaded zip is damaged.
    """
    from sagittal.core.formats.archive import EPISODE_CONFIG, EPISODE_MANIFEST, EPISODE_MARK  # slow import

    sha256: dict[str, str] = {}
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=_LEVEL) as archive:

        def add(name: str, content: bytes) -> None:
            info = zipfile.ZipInfo(name, EARLIEST)
            info.compress_type = zipfile.ZIP_STORED if name.endswith(_PACKED) else zipfile.ZIP_DEFLATED
            archive.writestr(info, content, compresslevel=_LEVEL)
            sha256[name] = hashlib.sha256(content).hexdigest()

        for name, content in _originals(blobs, recording):
            add(name, content)
        add(EPISODE_MANIFEST, _json(record.manifest or {}))
        add(EPISODE_CONFIG, _json(_settings(blobs, recording, record)))
        for name, blob in record.files.items():
            add(f"results/{name}", blobs.read(record.patient_id, blob.sha256))
        for name, content in report.items():
            add(f"report/{name}", content)
        if signed is not None:
            for name, blob in signed.files.items():
                add(f"report/{name}", blobs.read(record.patient_id, blob.sha256))
        mark = {
            "schema": SCHEMA,
            "written_by": CODE_VERSION,
            "analysed_by": record.code_version,
            "analysed_at": record.created_at.isoformat(timespec="seconds"),
            "config_sha256": record.config_sha256,
            "edits": [m.edit.to_json() for m in edits.made],
            "signed_report": None if signed is None else signed.describe(record, edits),
            "sha256": dict(sha256),
        }
        add(EPISODE_MARK, _json(mark))


def _settings(blobs: BlobStore, recording: StoredRecording, record: AnalysisRecord) -> Mapping[str, Any]:
    """Settings of the analysis, including those of an archive among the recording's files."""
    from sagittal.server.results.analysing import choose_config  # slow imports
    from sagittal.server.storage.files.blob_source import open_source

    files = [open_source(blobs, recording.patient_id, f.name, f.size, f.sha256) for f in recording.files]
    return choose_config(files, record.config)


def _originals(blobs: BlobStore, recording: StoredRecording) -> Iterator[tuple[str, bytes]]:
    """Iterate over the recording's files, unpacked from zip and gz."""
    from sagittal.core.formats.archive import EPISODE_RECORDING, expand  # slow import
    from sagittal.core.formats.source import SourceFile

    for f in recording.files:
        content = blobs.read(recording.patient_id, f.sha256)
        try:
            members = expand([SourceFile.of_bytes(f.name, content)])
        except InputError:
            members = [SourceFile.of_bytes(f.name, content)]
        for member in members:
            yield EPISODE_RECORDING + member.name, member.read()


def _json(value: Mapping[str, Any]) -> bytes:
    return json.dumps(value, ensure_ascii=False, indent=1, sort_keys=True).encode()
