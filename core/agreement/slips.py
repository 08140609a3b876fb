"""Detection of sensor slip: which sensor, when, and by what angle about the medio-lateral axis.

The positions of the adjacent joints in sensor axes do not depend on gait or posture. A slip rotates them all
by the same rotation (primary criterion). Each single stride gives the time and must not contradict the slip
(confirmation): a change of gait rotates strides too, so they are no proof on their own. Equations:
docs/science/agreement.md, "Slipped sensors".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from sagittal.core.agreement.params import JointParams, SlipParams
from sagittal.core.agreement.place_turns import (
    PlaceStep,
    PlaceTurns,
    find_turns,
    judge_turns,
    measure_step,
    turn_places,
)
from sagittal.core.agreement.strides import choose_leg, find_main_axis, find_stride_turns, find_swings
from sagittal.core.agreement.terms import SensorMotion, SensorTerms, find_terms
from sagittal.core.agreement.windows import JointWindows, compare_at_joint
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from sagittal.core.signals.rest import Window

REPAIRED: Final = "shank"
"""Segments whose slip is turned back: the angle from two joints is right to a degree there."""


@dataclass(frozen=True)
class SensorSlip:
    """A slip of one sensor.

    Parameters
    ----------
    at_s, within_s : time, and half the width of the excluded period. turn_rad : about `axis` (3,) in sensor
        axes: signals after the slip = this rotation of the signals without it. sd_rad : of it.
    at_rest : detected from two standing periods (standings.py), so that the time is too uncertain for a
        correction.
    by : evidence: joints, or the strides of this sensor alone (stride_slips.py), whose rotation is complete.
    """

    segment: Segment
    at_s: float
    within_s: float
    turn_rad: float
    sd_rad: float
    axis: tuple[float, float, float]
    at_rest: bool = False
    by: Literal["joints", "strides"] = "joints"

    @property
    def is_repaired(self) -> bool:
        """Whether later samples are corrected."""
        return self.by == "strides" or (self.segment.startswith(REPAIRED) and not self.at_rest)


def find_slips(
    recording: UniformRecording,
    terms: Mapping[Segment, SensorTerms],
    joints: Sequence[JointWindows],
    params: SlipParams,
) -> tuple[tuple[SensorSlip, ...], dict[Segment, Window]]:
    """The slips that pass all limits, at most one per sensor; sensor → period in which one would be detected.

    Parameters
    ----------
    terms, joints : of a recording with lags corrected.
    """
    rate_hz = recording.rate_hz
    axes: dict[Segment, Floats] = {}
    power: dict[Segment, Floats] = {}
    for s in (s for s in terms if s != "pelvis"):
        rate = terms[s].motion.rate
        axes[s] = find_main_axis(rate)
        power[s] = np.concatenate(([0.0], np.cumsum((rate**2).sum(axis=1))))
    moving = [_find_moving(w, power, rate_hz, params) for w in joints]
    turns = find_turns([w.choose(ok) for w, ok in zip(joints, moving, strict=True)], axes, params)
    half = 0.5 * max((w.width_s for w in joints), default=0.0)
    slips, motions = [], {s: x.motion for s, x in terms.items()}
    for segment, step in judge_turns(turns, half, params).items():
        valid = recording.sensors[segment].valid
        slip = question_strides(segment, step, axes[segment], motions, valid, rate_hz, half, params)
        if slip is not None:
            slips.append(slip)
    return tuple(slips), _find_judged(turns, half, params)


def _find_judged(
    turns: Mapping[Segment, PlaceTurns], half: float, params: SlipParams
) -> dict[Segment, Window]:
    """Moments with enough windows entirely before and after, for sensors where these cover most of the
    walk.
    """
    periods, least = {}, params.least_windows
    for segment, t_s in ((s, x.t_s) for s, x in turns.items()):
        start, end = float(t_s[least - 1]) + half, float(t_s[-least]) - half
        if end - start >= params.judged * float(t_s[-1] - t_s[0]):
            periods[segment] = start, end
    return periods


def is_moving(w: JointWindows, swing: Mapping[Segment, Floats], params: SlipParams) -> Bools:
    """Windows (m,) in which the leg sensors of a joint swing as in walking, and the joint misfit is small.

    Parameters
    ----------
    swing : leg sensor → mean square of its rate in each window (m,), rad²/s².
    """
    ok = w.residual < params.worst_residual
    for s in (w.first, w.second):
        if s in swing:
            ok &= swing[s] > params.least_swing**2
    return np.asarray(ok, np.bool_)


def _find_moving(
    w: JointWindows, power: Mapping[Segment, Floats], rate_hz: float, params: SlipParams
) -> Bools:
    swing = {}
    for s in {w.first, w.second} & set(power):
        a, b = (
            np.clip(np.round((w.t_s + x * w.width_s) * rate_hz).astype(int), 0, len(power[s]) - 1)
            for x in (-0.5, 0.5)
        )
        swing[s] = (power[s][b] - power[s][a]) / np.maximum(b - a, 1)
    return is_moving(w, swing, params)


def question_strides(
    segment: Segment,
    step: PlaceStep,
    axis: Floats,
    motions: Mapping[Segment, SensorMotion],
    valid: Bools,
    rate_hz: float,
    half: float,
    params: SlipParams,
) -> SensorSlip | None:
    """Confirm a slip by single strides: its time, None if they contradict it or it is too small without
    confirmation.

    Parameters
    ----------
    step : its time is relative to the first sample of `motions`. valid : (n,) samples of the sensor.
    """
    moment_s, margin_s = step.at_s, half
    share = None
    for leg in choose_leg(segment):
        borders = find_swings(motions[leg].rate, rate_hz) if leg in motions else np.zeros(0, np.int64)
        if len(borders) > 2 * params.strides:
            u = find_stride_turns(motions[segment], valid, borders, rate_hz, params)
            x = u.turn @ axis
            best = np.inf
            for k in range(params.strides, len(x) - params.strides + 1):
                when = 0.5 * (u.end_s[k - 1] + u.start_s[k])
                if abs(when - step.at_s) > half + 1.0:
                    continue
                far, near = 2 * params.near, params.near
                got = float(np.median(x[k : k + far]) - np.median(x[max(0, k - far) : k]))
                a, b = x[max(0, k - near) : k], x[k : k + near]
                # the cut that leaves least within its two sides
                left = float(np.abs(a - np.median(a)).sum() + np.abs(b - np.median(b)).sum())
                left -= 0.5 * len(a) * got * np.sign(step.size)
                if left < best:
                    best, share, moment_s = left, got / step.size, float(when)
                    margin_s = 0.5 * float(u.start_s[k] - u.end_s[k - 1]) + 0.6 + abs(moment_s - step.at_s)
            break
    witnessed = share is not None and share >= params.agree
    if not witnessed:
        moment_s, margin_s = step.at_s, half
        clear = abs(step.size) > params.sure_rad and step.z > 2.0 * params.z
        if share is not None and not clear:
            return None
    if abs(step.size) <= params.least_rad + (0.0 if witnessed else params.unwitnessed_rad):
        return None
    along = tuple(float(v) for v in axis)
    return SensorSlip(segment, moment_s, max(margin_s, params.within_s), step.size, step.sd, along)  # type: ignore[arg-type]


def compile_agreement_kernels() -> None:
    """Compile the kernels or load them from the cache, so that the first recording is not delayed."""
    n = 1000
    # single precision, as sensors give it: then arrays are of the kind that takes have
    wave = np.random.default_rng(0).normal(size=(2, n, 3)).astype(np.float32).astype(np.float64)
    still = SensorSignals("", wave[0], wave[1], None, np.ones(n, np.bool_), np.zeros(n, np.bool_))
    terms = find_terms(still, 100.0, JointParams())
    _ = terms.motion.level
    compare_at_joint(("pelvis", "thigh_l"), terms, terms, JointParams())
    turn, places = turn_places(np.ones((4, 2, 3)), np.array([1.0, 0.0, 0.0]))
    place_turns = PlaceTurns(np.arange(4.0), turn, places, 1.0)
    measure_step(place_turns, 2.0, 1.0, 1.0)
