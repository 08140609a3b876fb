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
"""What of a manifest says how sensors are worn and read."""


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


def read_proposal(c: Connection, blobs: BlobStore, found: AnalysisRecord) -> ProposedRepair | None:
    """Correction proposed by an analysis; None if there is none or its files are not the session's any
    more.
    """
    if REPAIRED not in found.files:
        return None
    this = recordings.current(c, found.session_id)
    if this is None or this.id != found.recording_id:
        return None
    said = json.loads(file_bytes(blobs, found, "analysis.json"))["setup"]
    repaired = json.loads(file_bytes(blobs, found, REPAIRED))
    changes = _list_changes(repaired, found.manifest)
    return ProposedRepair(tuple(said["evidence"]), take_setup(this.manifest, repaired), changes)


def _list_changes(repaired: Mapping[str, Any], before: Mapping[str, Any] | None) -> tuple[str, ...]:
    """Sensors with a changed segment or reading.

    Parameters
    ----------
    repaired : the proposed manifest. before : manifest of the analysis that proposes it.
    """
    said = manifest_of(before or {})
    wanted = manifest_of({key: repaired.get(key) for key in SETUP_KEYS})
    worn = {d.lower(): s for d, s in said.sensors.items()}
    known = {d.lower(): x for d, x in said.corrections.items()}
    changes = []
    for device, segment in sorted(wanted.sensors.items()):
        was = worn.get(device.lower())
        if segment is not None and was != segment:
            changes.append(f"Sensor {device} goes {'' if was is None else f'from {was} '}to {segment}.")
    for device, correction in sorted(wanted.corrections.items()):
        if correction != known.get(device.lower()):
            changes.append(f"Of sensor {device} {correction.say()}.")
    for place, words in sorted(wanted.mounting.items()):
        declared = said.mounting.get(place)
        if words != declared:
            instead = "" if declared is None else f", not “{declared}”"
            changes.append(f"The sensor of {place} is worn “{words}”{instead}.")
    return tuple(changes)


def read_without_limits(c: Connection, found: AnalysisRecord) -> dict[str, Any] | None:
    """Manifest of an analysis without user-defined test limits.

    None if its files are not the session's any more.
    """
    this = recordings.current(c, found.session_id)
    if this is None or this.id != found.recording_id:
        return None
    return {key: value for key, value in (this.manifest or {}).items() if key != "test_limits"}


def take_setup(manifest: Mapping[str, Any] | None, other: Mapping[str, Any] | None) -> dict[str, Any]:
    """Replace the setup of a manifest by that of another; height, protocol and columns are retained.

    >>> take_setup({"protocol": "walk", "corrections": {}}, {"sensors": {"A": "pelvis"}, "protocol": "tug"})
    {'protocol': 'walk', 'sensors': {'A': 'pelvis'}}
    """
    said = {key: value for key, value in (manifest or {}).items() if key not in SETUP_KEYS}
    return said | {key: (other or {})[key] for key in SETUP_KEYS if key in (other or {})}
