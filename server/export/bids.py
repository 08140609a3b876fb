"""BIDS-motion data set of one visit: sensor signals, contacts, strides.

Layout and columns: Brain Imaging Data Structure 1.9, "Motion" (doi:10.1038/s41597-024-03559-8). Free of
identifying data: pseudonyms, no dates, ages of 89 and above as 89+.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from sagittal.core.frames import SEGMENTS, Segment
from sagittal.server.export.ages import OLDEST
from sagittal.server.export.content import ExportContent
from sagittal.server.export.zipping import zip_files
from sagittal.server.report.files.columns import floats_of

VERSION: Final = "1.9.0"
TRACKSYS: Final = "imu"

CHANNELS: Final = ("name", "component", "type", "tracked_point", "units", "placement", "reference_frame")

PLACES: Final[dict[Segment, str]] = {
    "pelvis": "sacrum",
    "thigh_l": "left thigh",
    "thigh_r": "right thigh",
    "shank_l": "left shank",
    "shank_r": "right shank",
    "foot_l": "left foot",
    "foot_r": "right foot",
    "chest": "chest",
}
"""Segment → description of its sensor placement."""

KINDS: Final = (("acc", "", "ACCEL", "m/s^2", 1.0), ("gyr", "_dps", "GYRO", "rad/s", np.pi / 180.0))
"""Columns of signals.parquet → type and unit of the channel, and conversion factor."""


def write_bids(content: ExportContent) -> bytes:
    """Write a zip with the data set; raises FormatError `export_not_possible`."""
    table, meta = content.signals
    segments = [s for s in SEGMENTS if f"{s}_acc_x" in table.column_names]
    subject, visit = f"sub-{_label(content.visit.subject)}", f"ses-{_label(content.visit.visit)}"
    task = _label(content.visit.protocol.title())
    stem = f"{subject}/{visit}/motion/{subject}_{visit}_task-{task}"
    tracked = f"{stem}_tracksys-{TRACKSYS}"
    channels: list[Sequence[object]] = []
    columns = []
    for segment in segments:
        for name, ending, kind, unit, factor in KINDS:
            for axis in "xyz":
                column = floats_of(table, f"{segment}_{name}_{axis}{ending}")
                columns.append([_number(x) for x in (factor * column).tolist()])
                channel = (f"{segment}_{kind}_{axis}", axis, kind, segment, unit, PLACES[segment])
                channels.append((*channel, f"sensor_{segment}"))
    motion = "".join("\t".join(row) + "\n" for row in zip(*columns, strict=True))
    files = {
        "dataset_description.json": _json(_describe_dataset(content)),
        "README": README.encode(),
        "participants.tsv": _describe_person(content, subject),
        "participants.json": _json(PARTICIPANTS),
        f"{tracked}_motion.tsv": motion.encode(),
        f"{tracked}_motion.json": _json(
            _describe_motion(content, task, meta["rate_hz"], segments, table.num_rows)
        ),
        f"{tracked}_channels.tsv": _tsv(CHANNELS, channels),
        f"{tracked}_channels.json": _json({"reference_frame": {"Levels": _describe_frames(segments)}}),
        f"{stem}_events.tsv": _list_events(content),
        f"{stem}_events.json": _json(EVENTS),
    }
    return zip_files(files)


README: Final = """Motion of body-worn inertial sensors, written by Sagittal.

Signals are as measured, in each sensor's own axes, laid on one time axis. Holes of up to 0.1 s are
filled by straight lines; longer ones are n/a. Contacts and strides in the events are those that count
after a person's changes; strides that were left out say why.
"""

PARTICIPANTS: Final = {
    "age": {"Description": "Age at the visit; 89+ where it is 89 or more", "Units": "year"},
    "sex": {"Description": "Sex as entered", "Levels": {"F": "female", "M": "male"}},
    "height": {"Description": "Body height", "Units": "m"},
    "affected_side": {"Description": "Side that is affected", "Levels": {"left": "left", "right": "right"}},
}

EVENTS: Final = {
    "trial_type": {
        "Description": "What happened",
        "Levels": {
            "initial_contact": "The foot meets the floor",
            "terminal_contact": "The foot leaves the floor",
            "stride": "From an initial contact to the next of the same foot",
            "squat": "One squat of the side",
        },
    },
    "side": {"Description": "Foot or leg", "Levels": {"left": "left", "right": "right"}},
    "source": {"Description": "Detector that found a contact; manual: set by a person"},
    "counted": {"Description": "Whether a stride counts in means", "Levels": {"1": "yes", "0": "excluded"}},
    "excluded_reason": {"Description": "Rule, or manual: and a person's words, why a stride was left out"},
}


def _describe_dataset(content: ExportContent) -> dict[str, Any]:
    return {
        "Name": "Gait of body-worn inertial sensors",
        "BIDSVersion": VERSION,
        "DatasetType": "raw",
        "GeneratedBy": [{"Name": "Sagittal", "Version": content.visit.version or "unknown"}],
    }


def _describe_person(content: ExportContent, subject: str) -> bytes:
    v = content.visit
    age = None if v.age_years is None else v.age_years if v.age_years < OLDEST else f"{OLDEST}+"
    sex = {"female": "F", "male": "M"}.get(v.sex or "")
    header = ("participant_id", *PARTICIPANTS)
    return _tsv(header, [(subject, age, sex, v.height_m, v.affected_side)])


def _describe_motion(
    content: ExportContent, task: str, rate_hz: float, segments: Sequence[Segment], samples: int
) -> dict[str, Any]:
    each = 3 * len(segments)
    channel_types = ("ANGACCEL", "JNTANG", "LATENCY", "MAGN", "MISC", "ORNT", "POS", "VEL")
    return {
        "TaskName": task,
        "TaskDescription": f"{content.visit.protocol}: {content.visit.condition}".rstrip(": "),
        "SamplingFrequency": rate_hz,
        "SamplingFrequencyEffective": rate_hz,
        "TrackingSystemName": TRACKSYS,
        "RecordingType": "continuous",
        "RecordingDuration": samples / rate_hz,
        "MissingValues": "n/a",
        "MotionChannelCount": 2 * each,
        "TrackedPointsCount": len(segments),
        "ACCELChannelCount": each,
        "GYROChannelCount": each,
        **{f"{kind}ChannelCount": 0 for kind in channel_types},
    }


def _describe_frames(segments: Sequence[Segment]) -> dict[str, Any]:
    return {
        f"sensor_{segment}": {
            "SpatialAxes": "n/a",
            "RotationOrder": "n/a",
            "RotationRule": "right-hand",
            "Description": f"Axes x, y, z as the sensor on the {PLACES[segment]} prints them",
        }
        for segment in segments
    }


def _list_events(content: ExportContent) -> bytes:
    names = {"ic": "initial_contact", "tc": "terminal_contact"}
    rows: list[Sequence[Any]] = [
        (e.time_s, 0.0, names[e.kind], e.side, e.source, None, None) for e in content.bundle.events.events
    ]
    cycle = "stride" if content.bundle.repetitions is None else "squat"
    rows += [
        (c.start_s, c.end_s - c.start_s, cycle, c.side, None, int(c.excluded is None), c.excluded)
        for c in content.cycles
    ]
    rows.sort(key=lambda row: row[0])
    return _tsv(("onset", "duration", *EVENTS), rows)


def _label(text: str) -> str:
    """Convert text to a label of letters and digits only."""
    return re.sub(r"[^A-Za-z0-9]", "", text) or "unknown"


def _tsv(header: Sequence[str], rows: Sequence[Sequence[object]]) -> bytes:
    lines = ["\t".join(header), *("\t".join(map(_cell, row)) for row in rows)]
    return ("\n".join(lines) + "\n").encode()


def _cell(value: object) -> str:
    """Format a cell: undefined is n/a, tabs and line breaks are removed."""
    if value is None or value == "":
        return "n/a"
    return _number(value) if isinstance(value, float) else re.sub(r"\s+", " ", str(value))


def _number(value: float) -> str:
    return f"{value:.9g}" if np.isfinite(value) else "n/a"


def _json(value: object) -> bytes:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, indent=1).encode()
