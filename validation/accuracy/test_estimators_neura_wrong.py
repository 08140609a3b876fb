"""Wrong handling on neura_walk: effect on angles, and measures that reveal it.

Mistakes are applied to the recording or its calibration before the product's chain. Vicon only scores the
result; mistakes are revealed by joint residuals, refused zero velocities and corrections of anterior axes.
The last rows are six independent filters, which pass for flexion but fail for strides and headings
(docs/science/real-recordings.md, "Wrong handling", "Limits").
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from math import degrees, pi, radians
from typing import cast

import numpy as np
import pytest

from sagittal.core import events
from sagittal.core.body import contact_mask, forward_kinematics
from sagittal.core.body.corrected import correct_signals
from sagittal.core.body.erkf.filter import erkf_inputs, filter_block
from sagittal.core.body.erkf.headings import turn_forward_axes
from sagittal.core.body.erkf.health import REFUSED_PCT, RESIDUAL_MM
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.start import start_state
from sagittal.core.calibration import calibrate
from sagittal.core.calibration.gyro_pca import about_vertical
from sagittal.core.calibration.standing import vertical_frame
from sagittal.core.frames import FOOT, SIDES, Floats, Segment, Side
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from sagittal.core.signals.rest import index_window
from tests.helpers.neura import (
    BODY,
    RATE,
    SEGMENTS,
    WALK,
    angles_deg,
    chain,
    heading_against_vicon_deg,
    sensor_q,
    stride_errors_m,
    take,
)
from tests.helpers.neura_angles import scores
from tests.helpers.walks import neura_walk
from validation.figures import record

Calibrated = tuple[CalibratedRecording, Orientations]

LIVE = replace(ErkfParams.live(), joint_centre_sd=0.03)
"""The set of docs/science/real-recordings.md, "Wrong handling"."""

TURNED_DEG = 15.0
"""Two measures of a heading further apart are told (docs/science/real-recordings.md, "Heading")."""


@dataclass(frozen=True, eq=False)
class Result:
    """Figures of one case: residuals in mm, headings and angles in degrees, strides in cm, refusals in %."""

    residual_max: float
    residual_rms: float
    live_rms: float
    refused: float
    turned: float
    flexion_r: float
    adduction: float
    stride: float

    @property
    def caught(self) -> tuple[str, ...]:
        """Measures beyond their limit, without any reference."""
        result = {
            "residual": self.residual_rms > RESIDUAL_MM[0],
            "refused": self.refused > REFUSED_PCT[0],
            "heading": self.turned > TURNED_DEG,
        }
        return tuple(name for name, beyond in result.items() if beyond)


def calibrated(recording: UniformRecording) -> Calibrated:
    result = calibrate(recording)
    return result, estimate_orientations(result)


def swapped(a: Segment, b: Segment) -> Calibrated:
    """Two sensors exchanged."""
    sensors = neura_walk().sensors
    return calibrated(replace(neura_walk(), sensors={**sensors, a: sensors[b], b: sensors[a]}))


def legs_swapped() -> Calibrated:
    """All sensors of one leg on the other."""
    second = {s: s[:-1] + {"l": "r", "r": "l"}[s[-1]] for s in SEGMENTS if s != "pelvis"}
    sensors = dict(neura_walk().sensors)
    swap: dict[Segment, SensorSignals] = {s: sensors[cast("Segment", x)] for s, x in second.items()}
    return calibrated(replace(neura_walk(), sensors=sensors | swap))


def late(segment: Segment, by_s: float) -> Calibrated:
    """Delay of one sensor's clock."""
    x, shift = neura_walk().sensors[segment], round(by_s * RATE)

    def delayed(a: Floats) -> Floats:
        return np.concatenate((np.repeat(a[:1], shift, axis=0), a[:-shift]))

    moved = replace(x, acc=delayed(x.acc), gyr=delayed(x.gyr))
    return calibrated(replace(neura_walk(), sensors={**neura_walk().sensors, segment: moved}))


def mounted(segment: Segment, by_deg: float) -> Calibrated:
    """A forward axis taken wrongly."""
    return turn_forward_axes(*take(), {segment: radians(by_deg)})


def pelvis_by_gyro() -> Calibrated:
    """The pelvis' forward axis from the principal axis of its angular rate, which walking does not give."""
    trial, orientations = take()
    mount = trial.calibration.segments["pelvis"]
    walking = np.zeros(len(orientations.t_s), bool)
    for window in trial.calibration.walking:
        walking[index_window(window, RATE)] = True
    vertical = vertical_frame(mount.R_segment_sensor[1])
    rate = (trial.recording.sensors["pelvis"].gyr[walking] - mount.gyro_bias) @ vertical.T
    x, z = np.linalg.svd(rate[:, [0, 2]] - rate[:, [0, 2]].mean(axis=0), full_matrices=False)[2][0]
    apart = about_vertical(np.arctan2(-x, z)) @ vertical @ mount.R_segment_sensor.T
    off = float(np.arctan2(apart[0, 2], apart[0, 0]))
    # an axis has no sign: the better one
    return turn_forward_axes(trial, orientations, {"pelvis": (off + pi / 2) % pi - pi / 2})


CASES: dict[str, tuple[Callable[[], Calibrated], bool]] = {
    "healthy": (take, False),
    "thighs swapped": (lambda: swapped("thigh_l", "thigh_r"), True),
    "shanks swapped": (lambda: swapped("shank_l", "shank_r"), True),
    "feet swapped": (lambda: swapped("foot_l", "foot_r"), True),
    "legs swapped": (legs_swapped, True),
    "right thigh and shank swapped": (lambda: swapped("thigh_r", "shank_r"), True),
    "right thigh reversed": (lambda: mounted("thigh_r", 180.0), True),
    "right foot reversed": (lambda: mounted("foot_r", 180.0), True),
    "right thigh 100 ms late": (lambda: late("thigh_r", 0.1), True),
    "left thigh 100 ms late": (lambda: late("thigh_l", 0.1), True),
    "pelvis by gyro PCA": (pelvis_by_gyro, True),
    "right thigh turned +20°": (lambda: mounted("thigh_r", 20.0), True),
    "right thigh turned −20°": (lambda: mounted("thigh_r", -20.0), True),
}
"""How a case is made, and whether it must be caught."""


LEFT_SO = ("right thigh reversed", "right foot reversed", "pelvis by gyro PCA", "right thigh turned +20°")
"""Shown also without the turning back."""


@cache
def result(name: str, agree: bool = True) -> Result:
    make, _ = CASES[name]
    output = chain(*make(), agree=agree)
    track, rate = output.run.track, output.calibrated.recording.rate_hz
    # a run keeps no signals
    inputs = erkf_inputs(output.run.tree, *correct_signals(output.calibrated, output.run.segments), rate)
    inputs = replace(inputs, patched=output.run.inputs.patched)
    start = start_state(output.run.tree, inputs, LIVE, output.run.rest, q=output.run.start.nominal[:, 6:10])
    live, _ = filter_block(start, inputs, output.run.tree, LIVE)
    _, results = scores(output.angles_deg)
    return Result(
        residual_max=float(1000 * track.joint_residual.max()),
        residual_rms=float(output.residual_mm().max()),
        live_rms=float(1000 * np.sqrt(np.mean(live.joint_residual[WALK] ** 2, axis=0)).max()),
        refused=float(100 * track.refused.sum() / inputs.contact[WALK].sum()),
        turned=degrees(max((abs((x + pi) % (2 * pi) - pi) for x in output.turned.values()), default=0.0)),
        flexion_r=min(results[f"{n}_{end}"].r for n in ("hip_flexion", "knee_flexion") for end in "rl"),
        adduction=max(
            results[f"{n}_adduction_{end}"].offset_removed for n in ("hip", "knee") for end in "rl"
        ),
        stride=max((float(e.mean()) for e in output.strides_cm().values()), key=abs),
    )


@pytest.mark.parametrize("name", [n for n, (_, wrong) in CASES.items() if wrong])
def test_every_mistake_is_caught_by_a_measured_quantity(name: str) -> None:
    assert result(name).caught, name


def test_the_healthy_take_is_caught_by_none() -> None:
    results = result("healthy")
    assert results.caught == ()
    assert results.residual_rms < 0.7 * RESIDUAL_MM[0]


@pytest.mark.parametrize("name", [n for n in CASES if "reversed" in n or "turned" in n or "PCA" in n])
def test_a_wrong_forward_axis_is_not_only_caught_but_repaired(name: str) -> None:
    output, healthy = result(name), result("healthy")
    assert output.turned > TURNED_DEG
    assert output.adduction == pytest.approx(healthy.adduction, abs=0.3)
    assert output.flexion_r == pytest.approx(healthy.flexion_r, abs=0.003)


def lazy(key: dict[Segment, float]) -> tuple[list[str], float, float]:
    """Row, worst stride bias in cm and worst heading of the right leg of six-axis filters without joints."""
    result, orientations = turn_forward_axes(*take(), key)
    _, score = scores(angles_deg(orientations, result))
    contacts = events.detect(orientations)
    down = {
        s: contact_mask(orientations.t_s, contacts.times(s, "ic"), contacts.times(s, "tc")) for s in SIDES
    }
    poses = forward_kinematics(orientations, BODY, down)
    strides: dict[Side, Floats] = {s: 100 * stride_errors_m(s, poses.p[FOOT[s]]) for s in SIDES}
    bias = max((float(e.mean()) for e in strides.values()), key=abs)
    heading = float(np.abs(heading_against_vicon_deg(sensor_q(result, orientations))[1:4]).max())
    r = min(score[f"{n}_{end}"].r for n in ("hip_flexion", "knee_flexion") for end in "rl")
    adduction = max(score[f"{n}_adduction_{end}"].offset_removed for n in ("hip", "knee") for end in "rl")
    return [f"{r:.2f}", f"{adduction:.1f}", f"{bias:+.1f}"], bias, heading


def test_independent_filters_are_given_away_by_strides_and_headings() -> None:
    """Flexion agrees as well as the ErKF's; limits of docs/science/real-recordings.md, "Limits", that such a
    chain fails."""
    (r, _, _), bias, heading = lazy({})
    assert float(r) > 0.97
    assert abs(bias) > 2.5
    assert heading > 3.0
    (r, adduction, _), _, heading = lazy({"shank_r": radians(30.0)})
    assert float(r) > 0.97
    assert float(adduction) > 4.5
    assert heading > 30.0


def test_write_down_the_figures() -> None:
    rows = []
    visible_by_name = {name: result(name) for name in CASES}
    visible_by_name |= {f"{name}, left so": result(name, agree=False) for name in LEFT_SO}
    for name, x in visible_by_name.items():
        sizes = (x.residual_max, x.residual_rms, x.live_rms, x.refused, x.turned)
        vicon = [f"{x.flexion_r:.2f}", f"{x.adduction:.1f}", f"{x.stride:+.1f}"]
        rows.append([name, *(f"{size:.0f}" for size in sizes), *vicon, ", ".join(x.caught) or "–"])
    for name, by_key in (("healthy", {}), ("right shank turned 30°", {"shank_r": radians(30.0)})):
        cells, _, heading = lazy(by_key)  # type: ignore[arg-type]
        caught = f"strides, heading (right leg {heading:.0f}° off Vicon)"
        rows.append([f"six filters without joints, {name}", "", "", "", "", "", *cells, caught])
    record(
        "Wrong handling on neura_walk",
        [
            "mistake",
            "joints apart, max mm",
            "RMS",
            "RMS live, σ_JC 30 mm",
            "ZUPT refused %",
            "forward axis turned °",
            "least r of hip and knee flexion",
            "worst adduction RMSE °",
            "worst stride bias cm",
            "caught by",
        ],
        rows,
        "Whole chain on the recording with one mistake. Measured without reference and judged: joint ends "
        f"apart, RMS > {RESIDUAL_MM[0]:.0f} mm, zero velocities refused > {REFUSED_PCT[0]:.0f} %, "
        f"forward axis turned > {TURNED_DEG:.0f}°. The rest is against Vicon and shows what the mistake "
        "does. A wrong forward axis is found from the joints and turned back, so that only the last "
        "quantity tells; “left so” shows what it does otherwise.",
    )
