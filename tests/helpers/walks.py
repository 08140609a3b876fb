"""Walks that tests share: simulated ones with their truth, and neura_walk, each made and analysed once."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import fields, is_dataclass, replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.events.result import Stride
from sagittal.core.formats import SourceFile, parse_manifest, read_recording
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Bools, Floats, Segment
from sagittal.core.parameters.result import Parameter
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.rotation import rotate
from sagittal.core.signals.recording import Recording, SensorSignals, UniformRecording
from sagittal.core.simulate import SCRIPTS, WalkTruth, simulate, simulate_scenario
from sagittal.core.simulate.script import Script, SingleSteps
from sagittal.core.simulate.walker import SIGN, Walker
from sagittal.core.timeline import synchronise
from tests.data import data_folder
from tests.helpers.kept import keep, keep_recorded

NEURA = {
    "00B40B91": "pelvis", "00B40C45": "thigh_l", "00B40C3C": "thigh_r", "00B40BA5": "shank_l",
    "00B40C35": "shank_r", "00B40C55": "foot_l", "00B40C48": "foot_r", "00B40C44": None, "00B40C47": None,
    "00B40C49": None, "00B40C4A": None,
}  # fmt: skip

TOGETHER: Script = (SingleSteps(((0.02, 0.0, 0.55),)),)
"""A step that sets the foot beside the other: without it a simulated walk stops with one foot ahead."""


@keep
def simulated(name: str = "comfortable", seed: int = 0) -> tuple[UniformRecording, WalkTruth]:
    """A named script on the uniform axis, and its truth."""
    take = simulate_scenario(name, seed)
    return synchronise(take.recording), take.truth


@keep
def scripted(script: Script, seed: int = 0) -> tuple[UniformRecording, WalkTruth]:
    """A script of one's own for the reference person, with the sensors of the comfortable walk."""
    take = simulate(script, Walker(), seed, SCRIPTS["comfortable"].setup)
    return synchronise(take.recording), take.truth


@cache
def neura_recording() -> Recording:
    """The real walk of seven sensors as its files say it, or skip."""
    files = [
        SourceFile(p.name, p.stat().st_size, p.read_bytes)
        for p in sorted((data_folder("neura_walk") / "rawimu").glob("*.txt"))
    ]
    manifest = parse_manifest(json.dumps({"sensors": NEURA, "subject": {"height_m": 1.7}}).encode())
    return read_recording(files, manifest)


@keep_recorded
def neura_walk() -> UniformRecording:
    """The same on the uniform axis."""
    return synchronise(neura_recording())


@keep_recorded
def neura_analysis() -> TakeAnalysis:
    """Analysis of the walk."""
    return analyse(neura_recording())


@keep
def analysed(name: str, seed: int = 0) -> TakeAnalysis:
    """Analysis of a named script."""
    return analyse(simulate_scenario(name, seed).recording)


def only(recording: UniformRecording, *segments: Segment) -> UniformRecording:
    """The same take with some of its sensors."""
    return replace(recording, sensors={s: recording.sensors[s] for s in segments})


def turned(recording: UniformRecording, key: dict[Segment, Floats]) -> UniformRecording:
    """The same take with sensors mounted otherwise: v_new = q ⊗ v ⊗ q* for the quaternion of each segment."""
    sensors = {
        s: replace(x, acc=rotate(key[s], x.acc), gyr=rotate(key[s], x.gyr), mag=None) if s in key else x
        for s, x in recording.sensors.items()
    }
    return replace(recording, sensors=sensors)


def cut(recording: UniformRecording, start_s: float, end_s: float) -> UniformRecording:
    """A part of a take, its axis from zero again."""
    part = slice(round(start_s * recording.rate_hz), round(end_s * recording.rate_hz))

    def piece(x: SensorSignals) -> SensorSignals:
        return replace(
            x,
            acc=x.acc[part].copy(),
            gyr=x.gyr[part].copy(),
            mag=None,
            valid=x.valid[part].copy(),
            interpolated=x.interpolated[part].copy(),
        )

    t = recording.t_s[part] - recording.t_s[part][0]
    return replace(recording, t_s=t, sensors={s: piece(x) for s, x in recording.sensors.items()})


def lost(recording: UniformRecording, segment: Segment, start_s: float, end_s: float) -> UniformRecording:
    """The same take with one sensor silent for a while: invalid, the last value held."""
    x = recording.sensors[segment]
    a, b = round(start_s * recording.rate_hz), round(end_s * recording.rate_hz)
    acc, gyr, valid = x.acc.copy(), x.gyr.copy(), x.valid.copy()
    acc[a:b], gyr[a:b], valid[a:b] = acc[a - 1], gyr[a - 1], False
    return replace(
        recording, sensors={**recording.sensors, segment: replace(x, acc=acc, gyr=gyr, valid=valid)}
    )


def joint_gap(truth: WalkTruth) -> float:
    """Largest distance in m between the two ends that meet in any joint of seven true segments."""
    body = truth.body
    gaps = []
    for side in SIDES:
        thigh, shank, foot = THIGH[side], SHANK[side], FOOT[side]
        joints: tuple[tuple[Segment, Segment, list[float]], ...] = (
            ("pelvis", thigh, [0.0, 0.0, SIGN[side] * body.hip_width / 2]),
            (thigh, shank, [0.0, -body.thigh, 0.0]),
            (shank, foot, [0.0, -body.shank, 0.0]),
        )
        for upper, lower, joint in joints:
            end = truth.p[upper] + rotate(truth.q[upper], np.array(joint))
            gaps.append(np.abs(end - truth.p[lower]).max())
    return float(max(gaps))


def rms_deg(x: Floats, location: Bools | None = None) -> float:
    """Root mean square in degrees of the finite values of x (rad)."""
    x = x[np.isfinite(x) if location is None else location & np.isfinite(x)]
    return float(np.degrees(np.sqrt(np.mean(x**2))))


def assert_same_figures(result: Iterable[Parameter | Stride], expected: Iterable[Parameter | Stride]) -> None:
    """The same in every field, to 1e-12: sums over arrays of another layout differ in their last bit."""
    for a, b in zip(result, expected, strict=True):
        assert [f for f in _flat(a) if not isinstance(f, float)] == [
            f for f in _flat(b) if not isinstance(f, float)
        ]
        assert [f for f in _flat(a) if isinstance(f, float)] == pytest.approx(
            [f for f in _flat(b) if isinstance(f, float)], rel=1e-12, abs=1e-12
        )


def _flat(figure: object) -> Iterator[object]:
    if is_dataclass(figure):
        for field in fields(figure):
            yield from _flat(getattr(figure, field.name))
    elif isinstance(figure, tuple):
        for item in figure:
            yield from _flat(item)
    else:
        yield figure
