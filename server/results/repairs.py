"""Corrections of the sensor setup: proposals of an analysis, and setups of earlier ones to restore."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from sqlalchemy import Connection

from sagittal.core.formats.manifest import manifest_of
from sagittal.server.results.analyses import AnalysisRecord, file_bytes
from sagittal.server.results.analysing import REPAIRED
from sagittal.server.storage.files.blobs import BlobStore
from sagittal.server.uploads import recordings

SETUP_KEYS: Final = ("sensors", "corrections", "mounting")
"""Manifest keys for sensor placement and mapping."""


@dataclass(frozen=True)
class ProposedRepair:
    """Detected setup errors, in sentences, and a corrected manifest.

    Parameters
    ----------
    changes : change for each sensor, in sentences.
    """

    evidence: tuple[str, ...]
    manifest: Mapping[str, Any]
    changes: tuple[str, ...]


def read_proposal(c: Connection, blobs: BlobStore, record: AnalysisRecord) -> ProposedRepair | None:
    """Correction proposed by an analysis; None if there is none or its files are not the session's any
    more.
    """
    if REPAIRED not in record.files:
        return None
    this = recordings.current(c, record.session_id)
    if this is None or this.id != record.recording_id:
        return None
    setup = json.loads(file_bytes(blobs, record, "analysis.json"))["setup"]
    repaired = json.loads(file_bytes(blobs, record, REPAIRED))
    changes = _list_changes(repaired, record.manifest)
    return ProposedRepair(tuple(setup["evidence"]), take_setup(this.manifest, repaired), changes)


def _list_changes(repaired: Mapping[str, Any], current_manifest: Mapping[str, Any] | None) -> tuple[str, ...]:
    """Sensors with a changed segment or reading.

    Parameters
    ----------
    repaired : the proposed manifest. current_manifest : manifest of the analysis that proposes it.
    """
    current = manifest_of(current_manifest or {})
    proposed = manifest_of({key: repaired.get(key) for key in SETUP_KEYS})
    segments = {d.lower(): s for d, s in current.sensors.items()}
    known_corrections = {d.lower(): x for d, x in current.corrections.items()}
    changes = []
    for device, segment in sorted(proposed.sensors.items()):
        was = segments.get(device.lower())
        if segment is not None and was != segment:
            changes.append(f"Sensor {device} goes {'' if was is None else f'from {was} '}to {segment}.")
    for device, correction in sorted(proposed.corrections.items()):
        if correction != known_corrections.get(device.lower()):
            changes.append(f"Of sensor {device} {correction.say()}.")
    for place, words in sorted(proposed.mounting.items()):
        declared = current.mounting.get(place)
        if words != declared:
            instead = "" if declared is None else f", not “{declared}”"
            changes.append(f"The sensor of {place} is worn “{words}”{instead}.")
    return tuple(changes)


def read_without_limits(c: Connection, record: AnalysisRecord) -> dict[str, Any] | None:
    """Manifest of an analysis without user-defined test limits.

    None if its files are not the session's any more.
    """
    this = recordings.current(c, record.session_id)
    if this is None or this.id != record.recording_id:
        return None
    return {key: value for key, value in (this.manifest or {}).items() if key != "test_limits"}


def take_setup(manifest: Mapping[str, Any] | None, source: Mapping[str, Any] | None) -> dict[str, Any]:
    """Replace the setup of a manifest by that of another; height, protocol and columns are retained.

    >>> take_setup({"protocol": "walk", "corrections": {}}, {"sensors": {"A": "pelvis"}, "protocol": "tug"})
    {'protocol': 'walk', 'sensors': {'A': 'pelvis'}}
    """
    retained = {key: value for key, value in (manifest or {}).items() if key not in SETUP_KEYS}
    return retained | {key: (source or {})[key] for key in SETUP_KEYS if key in (source or {})}
