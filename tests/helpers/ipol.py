"""ipol_walks for tests: 22 walks of four healthy adults with manually checked events.

The packet counter is the clock: packets were lost, so row numbers are not times.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final

import numpy as np

from sagittal.core.formats import SourceFile, parse_manifest, read_recording
from sagittal.core.frames import FOOT, SIDES, Floats, Segment, Side
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.signals.recording import Recording, Subject
from tests.data import data_folder
from tests.helpers.kept import keep_recorded

RATE: Final = 100.0
SUBJECTS: Final = ("11", "12", "13", "14")
FEET: Final = tuple(FOOT.values())
WALKS: Final = tuple(
    f"{subject}-{trial}"
    for subject, trials in zip(SUBJECTS, (6, 6, 6, 4), strict=True)
    for trial in range(1, trials + 1)
)
"""All walks, "subject-trial"."""


@dataclass(frozen=True, eq=False)
class CheckedEvents:
    """Manually checked events of one walk, in s on the counter's clock.

    Parameters
    ----------
    contacts, leavings : side → times, one pair per swing. turn_s : of the body. walk_s : the whole walk.
    """

    contacts: dict[Side, Floats]
    leavings: dict[Side, Floats]
    turn_s: tuple[float, float]
    walk_s: tuple[float, float]


def ipol_manifest() -> bytes:
    """Manifest of three tab-separated tables with one packet counter: two shoes and the low back."""
    names = {kind: [f"{kind}_{axis}" for axis in "XYZ"] for kind in ("Acc", "Gyr", "Mag")}
    columns = {"acc": names["Acc"], "gyr": names["Gyr"], "mag": names["Mag"]}
    entry = {
        "skip_rows": 1,
        "separator": "\t",
        "counter": {"column": "PacketCounter", "rate_hz": RATE},
        "acc_unit": "m/s2",
        "gyr_unit": "rad/s",
    }
    places = {"*_lf.txt": "foot_l", "*_rf.txt": "foot_r", "*_lb.txt": "pelvis"}
    sources = [{"file": file, "columns": {place: columns}, **entry} for file, place in places.items()]
    return json.dumps({"sources": sources}).encode()


@cache
def ipol_recording(walk: str, *segments: Segment) -> Recording:
    """A walk as its files say it, with the person's height; with some of its sensors where they are named."""
    folder = data_folder("ipol_walks")
    files = [SourceFile.of_path(path) for path in sorted(folder.glob(f"{walk}_*.txt"))]
    whole, height_cm = read_recording(files, parse_manifest(ipol_manifest())), _said(walk)["Height"]
    segment_names = segments or tuple(s for s in whole.segments.values() if s is not None)
    return replace(
        whole,
        streams={d: x for d, x in whole.streams.items() if whole.segments[d] in segment_names},
        segments={d: s for d, s in whole.segments.items() if s in segment_names},
        subject=Subject(height_m=height_cm / 100.0 if np.isfinite(height_cm) else None),
    )


@keep_recorded
def ipol_analysis(walk: str, *segments: Segment) -> TakeAnalysis:
    """Analysis of a walk."""
    return analyse(ipol_recording(walk, *segments))


def first_s(recording: Recording) -> float:
    """Counter's time of the first sample of the common axis."""
    return max(float(s.t_s[0]) for s in recording.streams.values())


@cache
def _said(walk: str) -> dict[str, Any]:
    fields: dict[str, Any] = json.loads(data_folder("ipol_walks", f"{walk}.json").read_text())
    return fields


@cache
def checked_events(walk: str) -> CheckedEvents:
    """Manually checked events of one walk."""
    message = _said(walk)
    pairs = {side: np.array(message[f"{side.capitalize()}FootEvents"], np.float64) / RATE for side in SIDES}
    turn, whole = (
        np.array(message[name], np.float64) / RATE for name in ("UTurnBoundaries", "TrialBoundaries")
    )
    return CheckedEvents(
        contacts={side: x[:, 1] for side, x in pairs.items()},
        leavings={side: x[:, 0] for side, x in pairs.items()},
        turn_s=(float(turn[0]), float(turn[1])),
        walk_s=(float(whole[0]), float(whole[1])),
    )
