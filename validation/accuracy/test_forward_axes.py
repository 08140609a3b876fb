"""Anterior axes by likelihood against the truth of virtual patients, and their stated uncertainty.

Truth is the walking direction in each sensor's rest world: true heading of the segment in standing, less the
pelvis's. Spreads of the measures come from these people and from neura_walk and qmt_fullbody
(docs/science/calibration.md, "Forward by likelihood").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import Any, cast

import numpy as np

from sagittal.core.calibration import calibrate
from sagittal.core.frames import FOOT, SHANK, THIGH, Segment
from sagittal.core.rotation import to_matrix, wrap_angle, yaw
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import index_window
from sagittal.core.simulate import WalkTruth
from sagittal.core.simulate.patients import PATIENTS
from tests.helpers.walks import only, simulated
from validation.figures import record
from validation.marks import WHOLE, sample

SEEDS = sample((0, 1, 2), 3)
PAIRS: tuple[tuple[Segment, ...], ...] = (tuple(THIGH.values()), tuple(SHANK.values()))
"""Sensors worn without their neighbours: no joint speaks of them."""


@dataclass(frozen=True)
class ForwardError:
    """One forward axis: its error and its standard deviation, and what single measures are off, degrees."""

    segment: Segment
    off: float
    sd: float
    told: bool
    single: Mapping[str, float]


def find_errors(recording: UniformRecording, truth: WalkTruth) -> list[ForwardError]:
    calibration = calibrate(recording).calibration
    standing = index_window(calibration.zero, recording.rate_hz)
    facing = {s: float(np.angle(np.exp(1j * yaw(truth.q[s][standing])).mean())) for s in truth.q}
    result = []
    for s, x in calibration.segments.items():
        ahead = (x.R_segment_sensor @ to_matrix(truth.mounts[s].q_segment_sensor).T)[:, 0]
        off = float(wrap_angle(np.arctan2(ahead[2], ahead[0]) + facing[s] - facing["pelvis"]))
        facts = cast("Mapping[str, Any]", calibration.diagnostics[s])
        single = {v["source"]: float(np.degrees(wrap_angle(off + v["off_rad"]))) for v in facts["votes"]}
        assert x.forward_sd is not None
        notices = any(n.code == "forward_uncertain" and n.sensor == s for n in calibration.notices)
        result.append(
            ForwardError(s, float(np.degrees(off)), float(np.degrees(x.forward_sd)), notices, single)
        )
    return result


@cache
def all_errors() -> dict[str, tuple[list[ForwardError], list[ForwardError]]]:
    """Patient → errors with seven sensors, and with pairs of them alone."""
    result = {}
    for name in PATIENTS:
        seven: list[ForwardError] = []
        pairs: list[ForwardError] = []
        for seed in SEEDS:
            recording, truth = simulated(name, seed)
            seven += find_errors(recording, truth)
            for pair in PAIRS if seed == 0 else ():
                pairs += find_errors(only(recording, *pair), truth)
        result[name] = seven, pairs
    return result


def rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def test_patients_have_forward_axes_within_six_degrees() -> None:
    rows = []
    for name, (seven, _) in all_errors().items():
        loose = [e for e in seven if e.segment not in FOOT.values()]
        row = [name, f"{rms([e.off for e in loose]):.1f}", f"{max(abs(e.off) for e in loose):.1f}"]
        for source in ("velocity", "acceleration"):
            separate = [e.single[source] for e in loose if source in e.single]
            row.append(f"{rms(separate):.1f}" if separate else "–")
        feet = [e.off for e in seven if e.segment in FOOT.values()]
        rows.append([*row, f"{rms(feet):.1f}", f"{max(e.sd for e in seven):.1f}"])
        assert max(abs(e.off) for e in loose) < 6.0
        assert not any(e.told for e in seven)
    loose = [e for seven, _ in all_errors().values() for e in seven if e.segment not in FOOT.values()]
    assert rms([e.off for e in loose]) < 2.0
    header = [
        "virtual patient", "weighed, RMS °", "largest °", "velocity alone °", "acceleration alone °",
        "feet °", "largest σ °",
    ]  # fmt: skip
    note = (
        f"Seven sensors, {len(SEEDS)} seeds; pelvis, thighs and shanks {rms([e.off for e in loose]):.1f}° "
        "together. By a rule that takes one measure they were 4.4°, a hemiparetic thigh 21°. Feet keep the "
        "way of their strides. Limit 6°; none is told as uncertain."
    )
    if WHOLE:
        record("Forward axes of virtual patients", header, rows, note)


def test_the_uncertainty_is_that_of_the_errors() -> None:
    errors = [e for seven, pairs in all_errors().values() for e in (*seven, *pairs)]
    errors = [e for e in errors if e.segment not in FOOT.values()]
    edges = [0.0, 2.5, 3.5, 90.0]
    rows = []
    for low, high in pairwise(edges):
        held = [e for e in errors if low <= e.sd < high]
        if held:
            last = high == edges[-1]
            beyond = float(np.mean([abs(e.off) > 10.0 for e in held]))
            row = [
                f"{low:g}° and more" if last else f"{low:g} to {high:g}°",
                str(len(held)),
                f"{np.mean([e.sd for e in held]):.1f}",
            ]
            rows.append([*row, f"{rms([e.off for e in held]):.1f}", f"{100 * beyond:.0f}"])
    assert np.mean([abs(e.off) > 2.0 * e.sd for e in errors]) < 0.05
    assert 0.4 < rms([e.off / e.sd for e in errors]) < 1.3
    header = ["σ that is given", "axes", "mean σ °", "RMS error °", "off by more than 10°, %"]
    note = (
        "The same people, seven sensors, and thighs or shanks alone. RMS of error over σ: "
        f"{rms([e.off / e.sd for e in errors]):.2f}."
    )
    if WHOLE:
        record("Uncertainty of forward axes", header, rows, note)
