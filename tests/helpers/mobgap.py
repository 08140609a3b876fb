"""mobgap_lowback for tests: trials of one lower-back sensor with the walking that INDIP detected.

INDIP (pressure insoles and foot sensors) is the reference for initial contacts; steps outside its walking
periods are not errors (the stereophotogrammetry has one more walk in Test11).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.io import loadmat

from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.signals.recording import ImuStream, Recording, UniformRecording
from sagittal.core.timeline import synchronise
from tests.data import data_folder
from tests.helpers.kept import keep_recorded

TRIALS = (("Test5", "Trial1"), ("Test5", "Trial2"), ("Test11", "Trial1"))
"""Two straight walks of 5 m, and daily life for two minutes: one healthy older adult."""


@dataclass(frozen=True, eq=False)
class Period:
    """One walking period of the reference: range, initial contacts (s) and their feet, its own cadence."""

    start_s: float
    end_s: float
    contacts: Floats
    sides: tuple[str, ...]
    cadence_spm: float


@dataclass(frozen=True)
class SeenTurn:
    """A turn as the cameras have it, left positive; `whole` = it neither begins nor ends with its walk."""

    start_s: float
    end_s: float
    angle_deg: float
    whole: bool


def _signals(trial: tuple[str, str]) -> object:
    data = loadmat(
        data_folder("mobgap_lowback", "data", "lab", "HA", "001") / "data.mat",
        squeeze_me=True,
        struct_as_record=False,
    )["data"]
    return getattr(getattr(data.TimeMeasure1, trial[0]), trial[1])


@cache
def recording(trial: tuple[str, str]) -> Recording:
    """The lower-back sensor of a trial, mapped to the pelvis."""
    sensor = _signals(trial).SU.LowerBack  # type: ignore[attr-defined]
    n = len(sensor.Acc)
    stream = ImuStream(
        device_id="LowerBack",
        source="data.mat",
        t_s=np.arange(n) / 100.0,
        acc=np.array(sensor.Acc, np.float64) * GRAVITY,
        gyr=np.radians(np.array(sensor.Gyr, np.float64)),
        mag=None,
        quat=None,
        rate_hz=100.0,
        clock="index",
        digest="-".join(trial),
    )
    return Recording({"LowerBack": stream}, {"LowerBack": "pelvis"})


@keep_recorded
def uniform(trial: tuple[str, str]) -> UniformRecording:
    """The same on the uniform axis."""
    return synchronise(recording(trial))


@cache
def periods(trial: tuple[str, str]) -> tuple[Period, ...]:
    """Walking periods of INDIP; a contact written down twice within 0.1 s counts once."""
    result = []
    reference = _signals(trial).Standards.INDIP.ContinuousWalkingPeriod  # type: ignore[attr-defined]
    for w in np.atleast_1d(reference):
        times = np.asarray(w.InitialContact_Event, np.float64)
        whole = np.isfinite(times) & np.concatenate(([True], np.diff(times) > 0.1))
        feet = tuple(str(s).lower() for s in np.asarray(w.InitialContact_LeftRight)[whole])
        result.append(Period(float(w.Start), float(w.End), times[whole], feet, float(w.Cadence)))
    return tuple(result)


@cache
def turns_of(trial: tuple[str, str]) -> tuple[tuple[tuple[float, float], ...], tuple[SeenTurn, ...]]:
    """Walks of the stereophotogrammetry, s, and the turns it saw in them."""
    walks, result = [], []
    reference = _signals(trial).Standards.Stereophoto.ContinuousWalkingPeriod  # type: ignore[attr-defined]
    for w in np.atleast_1d(reference):
        walks.append((float(w.Start), float(w.End)))
        rows = (np.atleast_1d(getattr(w, f"Turn_{name}")).astype(float) for name in ("Start", "End", "Angle"))
        for start, end, angle in zip(*rows, strict=True):
            whole = start > w.Start + 0.1 and end < w.End - 0.1
            result.append(SeenTurn(float(start), float(end), float(angle), bool(whole)))
    return tuple(walks), tuple(result)


def turns(trial: tuple[str, str]) -> tuple[tuple[float, float], ...]:
    """Turns of at least 45° of INDIP while walking, s; parts of one direction that touch are one turn."""
    listed: list[tuple[float, float, float]] = []
    reference = _signals(trial).Standards.INDIP.ContinuousWalkingPeriod  # type: ignore[attr-defined]
    for w in np.atleast_1d(reference):
        columns = (np.atleast_1d(getattr(w, f"Turn_{name}")) for name in ("Start", "End", "Angle"))
        listed += [(float(a), float(b), float(angle)) for a, b, angle in zip(*columns, strict=True)]
    return tuple((a, b) for a, b, angle in listed if abs(angle) >= 45.0)
