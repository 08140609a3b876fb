"""Clean recordings that mistakes are made in, and which of them may choose a limit."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Final

from sagittal.core.errors import SagittalError
from sagittal.core.formats import list_source_files, parse_manifest, read_recording
from sagittal.core.frames import SEGMENTS, Segment
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.signals.recording import Recording
from sagittal.core.simulate import PATIENTS, simulate_scenario
from tests.data import data_folder
from tests.helpers.ipol import WALKS
from tests.helpers.real_takes import read_take

FEET: Final[tuple[Segment, ...]] = ("foot_l", "foot_r")
SETS: Final[dict[str, tuple[Segment, ...]]] = {
    "seven": ("pelvis", "thigh_l", "thigh_r", "shank_l", "shank_r", "foot_l", "foot_r"),
    "feet + pelvis": ("pelvis", *FEET),
    "feet": FEET,
    "lower back": ("pelvis",),
}

SIMULATED: Final = tuple(sorted(PATIENTS))
CHOOSING: Final = (
    *(w for w in WALKS if w.startswith(("11", "12"))),
    "antalgic", "crouch", "elderly", "healthy", "parkinson", "step_asym",
)  # fmt: skip
"""Recordings on which limits may be chosen; all others only judge."""
JUDGING: Final = (
    *(w for w in WALKS if w.startswith(("13", "14"))),
    "neura_walk", "qmt_fullbody", "gaitmap_foot", "stroke_treadmill",
    *(name for name in SIMULATED if name not in CHOOSING),
)  # fmt: skip

STROKE: Final[dict[str, Segment]] = {
    "47787": "foot_l", "47796": "foot_r", "47783": "shank_l", "47792": "shank_r", "4778F": "pelvis",
}  # fmt: skip


@lru_cache(4)
def read_clean(name: str) -> Recording:
    """A recording by name; simulated people who judge are of another seed and height."""
    if name in PATIENTS:
        other = name in JUDGING
        return simulate_scenario(name, seed=205 if other else 5, height_m=1.66 if other else 1.79).recording
    if name == "stroke_treadmill":
        files = list(list_source_files(sorted(data_folder(name).glob("MT_*.txt"))))
        read = read_recording(files, parse_manifest(b'{"sources": [{"file": "*.txt", "rate_hz": 100}]}'))
        return replace(read, segments={d: STROKE[d[-5:]] for d in read.streams}, protocol="treadmill")
    return read_take(name)


def choose_sensors(recording: Recording, worn: tuple[Segment, ...]) -> Recording | None:
    """The recording with these sensors alone; None where one is missing."""
    kept = {d: s for d, s in recording.segments.items() if s in worn}
    if sorted(s for s in kept.values() if s) != sorted(worn):
        return None
    return replace(recording, streams={d: recording.streams[d] for d in kept}, segments=kept)


def list_takes(names: tuple[str, ...] = (*CHOOSING, *JUDGING)) -> list[tuple[str, str]]:
    """All (recording, sensor set) that exist."""
    found = []
    for name in names:
        recording = read_clean(name)
        there = {s for s in recording.segments.values() if s in SEGMENTS}
        found += [(name, kind) for kind, worn in SETS.items() if set(worn) <= there]
    return found


@lru_cache(8)
def analyse_clean(name: str, kind: str) -> TakeAnalysis | None:
    """What the product makes of it without a mistake; None where it makes nothing."""
    recording = choose_sensors(read_clean(name), SETS[kind])
    if recording is None:
        return None
    try:
        found = analyse(recording)
    except SagittalError:
        return None
    return found if found.parameters else None
