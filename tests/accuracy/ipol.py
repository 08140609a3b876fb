"""ipol_walks for tests: 22 walks there and back of four healthy adults, with events that people checked.

The sensors' packet counter is the clock: packets were lost, and a row says nothing about its time.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from core.frames import SIDES, Floats, Segment, Side
from core.recording import ImuStream, Recording, Subject
from tests.data import data_folder

RATE: Final = 100.0
FOLDER: Final = "ipol_walks"
FILES: Final[dict[Segment, str]] = {"foot_l": "lf", "foot_r": "rf", "pelvis": "lb"}
FEET: Final[tuple[Segment, ...]] = ("foot_l", "foot_r")
WALKS: Final = tuple(
    f"{subject}-{trial}"
    for subject, trials in ((11, 6), (12, 6), (13, 6), (14, 4))
    for trial in range(1, trials + 1)
)
WAY_M: Final = 10.0
"""From the start to the turn, and back."""


@dataclass(frozen=True, eq=False)
class CheckedEvents:
    """What people say of one walk, all in s on the counter's clock.

    Parameters
    ----------
    contacts, leavings : side → times, one pair per swing. turn_s : of the body. walk_s : the whole walk.
    """

    contacts: dict[Side, Floats]
    leavings: dict[Side, Floats]
    turn_s: tuple[float, float]
    walk_s: tuple[float, float]


def _stream(walk: str, segment: Segment) -> ImuStream:
    name = f"{walk}_{FILES[segment]}.txt"
    rows = np.genfromtxt(data_folder(FOLDER, name), delimiter="\t", skip_header=2)
    counter, first = np.unique(rows[:, 0], return_index=True)
    rows = rows[first]
    return ImuStream(
        device_id=segment,
        source=name,
        t_s=counter / RATE,
        acc=np.ascontiguousarray(rows[:, 1:4]),
        gyr=np.ascontiguousarray(rows[:, 4:7]),
        mag=None,
        quat=None,
        rate_hz=RATE,
        clock="counter",
        digest=hashlib.sha256(rows[:, 1:7].tobytes()).hexdigest(),
    )


@cache
def ipol_recording(walk: str, segments: tuple[Segment, ...] = FEET) -> Recording:
    """One walk with some of its sensors, or skip."""
    height = _labels(walk)["Height"]
    return Recording(
        streams={s: _stream(walk, s) for s in segments},
        segments={s: s for s in segments},
        subject=Subject(height_m=height / 100.0 if np.isfinite(height) else None),
    )


def first_s(recording: Recording) -> float:
    """Counter's time of the first sample of the common axis."""
    return max(float(s.t_s[0]) for s in recording.streams.values())


@cache
def _labels(walk: str) -> dict:  # type: ignore[type-arg] # as the file has it
    found = json.loads(data_folder(FOLDER, f"{walk}.json").read_text())
    assert isinstance(found, dict)
    return found


@cache
def checked_events(walk: str) -> CheckedEvents:
    """What people say of one walk."""
    labels = _labels(walk)
    pairs = {side: np.array(labels[f"{side.capitalize()}FootEvents"]) / RATE for side in SIDES}
    turn, whole = (tuple(np.array(labels[k]) / RATE) for k in ("UTurnBoundaries", "TrialBoundaries"))
    return CheckedEvents(
        contacts={side: x[:, 1] for side, x in pairs.items()},
        leavings={side: x[:, 0] for side, x in pairs.items()},
        turn_s=(float(turn[0]), float(turn[1])),
        walk_s=(float(whole[0]), float(whole[1])),
    )
