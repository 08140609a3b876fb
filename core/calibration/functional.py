"""Functional calibration movements: swings of one leg from the hip, and bows of the trunk.

Both rotate a segment about its medio-lateral axis, which is the principal axis of its angular rate
(Nazarahari 2021, thesis, ch. 3). They are detected by the segments that remain still: the other leg, or both
feet.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from sagittal.core.calibration.anterior import AnteriorAxis
from sagittal.core.calibration.forward import ForwardMeasure, ForwardParams
from sagittal.core.calibration.gyro_pca import (
    GOOD_AXIS,
    WEAK_MARGIN,
    about_vertical,
    count_repetitions,
    flexion_axis,
    sagittal_angle,
)
from sagittal.core.calibration.heading import nearest_sign
from sagittal.core.calibration.mounting import read_declared_angle
from sagittal.core.calibration.standing import SensorAtRest, vertical_frame
from sagittal.core.calibration.walking import TRUNK
from sagittal.core.errors import CalibrationError, Notice
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Bools, Floats, Segment, Side
from sagittal.core.message import Message
from sagittal.core.plurals import plural
from sagittal.core.rotation import find_lengths, find_vertical
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import find_runs

FunctionalMethod = Literal["hip_swing", "trunk_bow"]
FUNCTIONAL: Final[tuple[FunctionalMethod, ...]] = ("hip_swing", "trunk_bow")

FORWARD: Final[Mapping[FunctionalMethod, float]] = {"hip_swing": 1.0, "trunk_bow": -1.0}
"""Sign of the sagittal angle on the way forward: feet swing forward under the hip, a head forward over it."""

EDGE_S: Final = 0.75
"""Half the time over which the rates of a swing are averaged."""

UP: Final = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class FunctionalParams:
    """Detection of swings and bows (docs/science/calibration.md, "Swings and bows").

    Parameters
    ----------
    swing_s, bow_s : averaging time of the rates. swing_rate, bow_rate : minimum rates of the leg and of the
    trunk, rad/s. still_rate : maximum rate of the other leg, or of feet and shanks. still_share : maximum
    ratio of that to the rate of the moving segment. pause_s : shorter breaks are bridged. shortest_s :
    minimum total duration.
    swings, bows : requested repetitions; with at least half of them the axis is used, with a notice.
    """

    swing_s: float = 1.5
    bow_s: float = 3.0
    swing_rate: float = 0.5
    bow_rate: float = 0.2
    still_rate: float = 0.3
    still_share: float = 0.4
    pause_s: float = 2.0
    shortest_s: float = 5.0
    swings: int = 10
    bows: int = 5


@dataclass(frozen=True, eq=False)
class FunctionalMovements:
    """Samples of the functional movements.

    Parameters
    ----------
    swings : side → (n,) that leg swings while the other supports. bows : (n,) the trunk bows with the feet
    still.
    """

    swings: Mapping[Side, Bools]
    bows: Bools

    @property
    def anywhere(self) -> Bools:
        """Samples (n,) of any of them, to be excluded from walking."""
        return np.asarray(np.logical_or.reduce([*self.swings.values(), self.bows]))

    def shown_by(self, segment: Segment) -> tuple[FunctionalMethod, Bools]:
        """The movement that reveals the axis of a segment, and its samples."""
        if segment in TRUNK:
            return "trunk_bow", self.bows
        side = next(s for s in SIDES if segment in (THIGH[s], SHANK[s], FOOT[s]))
        return "hip_swing", self.swings[side]


def find_functional_movements(recording: UniformRecording, params: FunctionalParams) -> FunctionalMovements:
    """Detect swings and bows; recordings without them are valid too.

    The other leg must carry a sensor, and for bows both shanks or feet: with a single sensor a swing cannot
    be distinguished from a step.
    """
    signals, rate = recording.sensors, recording.rate_hz
    legs = {side: [s for s in (THIGH[side], SHANK[side], FOOT[side]) if s in signals] for side in SIDES}
    none = np.zeros(len(recording.t_s), np.bool_)
    if not all(legs.values()):
        return FunctionalMovements(dict.fromkeys(SIDES, none), none)
    pace = {side: _average(recording, legs[side], params.swing_s) for side in SIDES}
    swings: dict[Side, Bools] = {}
    for side, opposite in ((SIDES[0], SIDES[1]), (SIDES[1], SIDES[0])):
        mine, theirs = pace[side], pace[opposite]
        single = (theirs < params.still_rate) & (theirs < params.still_share * mine)
        swings[side] = _join(single & (mine > params.swing_rate), rate, params)
    trunk = [s for s in TRUNK if s in signals]
    low = {side: [s for s in legs[side] if s != THIGH[side]] for side in SIDES}
    if not trunk or not all(low.values()):
        return FunctionalMovements(swings, none)
    bowing = _average(recording, trunk, params.bow_s)
    feet = np.maximum(*(_average(recording, low[side], params.bow_s) for side in SIDES))
    thighs = [s for s in THIGH.values() if s in signals]
    upright = _average(recording, thighs, params.bow_s) if thighs else np.zeros(len(none))
    bows = (bowing > params.bow_rate) & (np.maximum(feet, upright) < params.still_share * bowing)
    return FunctionalMovements(swings, _join(bows & (feet < params.still_rate), rate, params))


def find_functional_axes(
    recording: UniformRecording,
    movements: FunctionalMovements,
    standing: Mapping[Segment, SensorAtRest],
    q: Mapping[Segment, Floats],
    params: FunctionalParams,
    forward: ForwardParams,
) -> dict[Segment, AnteriorAxis]:
    """Anterior axis of every sensor with enough repetitions of its segment's movement.

    Parameters
    ----------
    q : segment → (n, 4) sensor to its rest frame.
    """
    axes: dict[Segment, AnteriorAxis] = {}
    for segment, signals in recording.sensors.items():
        movement, mask = movements.shown_by(segment)
        mask = mask & signals.valid
        if not mask.any():
            continue
        R_vertical = vertical_frame(standing[segment].up)
        try:
            axis = flexion_axis(signals.gyr[mask] - standing[segment].gyro_bias, R_vertical, segment)
        except CalibrationError:
            continue  # turned about several axes: the walk has to show it
        up = find_vertical(q[segment])
        angle, margin = _give_sign(-axis.gamma, movement, up[mask], R_vertical)
        written = read_declared_angle(recording.mounting.get(segment, ""), R_vertical, segment)
        if written is not None:
            angle, margin = nearest_sign(angle, written), np.inf
        bend = sagittal_angle(up, about_vertical(-angle) @ R_vertical) * FORWARD[movement]
        requested = params.swings if movement == "hip_swing" else params.bows
        done = sum(count_repetitions(bend[a:b]) for a, b in find_runs(_widen(mask, recording.rate_hz)))
        if 2 * done < requested:
            continue
        notices = tuple(_tell(segment, movement, done, requested, axis.rho, margin))
        facts = {"source": movement, "rho": axis.rho, "repetitions": done, "asked": requested}
        measure = ForwardMeasure(movement, angle, forward.movement_sd, forward.movement_doubt)
        axes[segment] = AnteriorAxis(
            angle, movement, axis.rho, notices, facts, measures=(measure,), kept=True
        )
    return axes


def _give_sign(
    axis: float, movement: FunctionalMethod, up: Floats, R_vertical: Floats
) -> tuple[float, float]:
    """Forward end of an axis, and how clear that is, rad: legs swing forward, trunks bow forward.

    Parameters
    ----------
    up : (m, 3) the vertical in sensor axes during the movement.
    """
    bend = float(sagittal_angle(up, about_vertical(-axis) @ R_vertical).mean())
    forward = bend * FORWARD[movement]
    return (axis if forward >= 0.0 else nearest_sign(axis, axis + np.pi)), abs(forward)


def _tell(
    segment: Segment, movement: FunctionalMethod, done: int, requested: int, rho: float, margin: float
) -> Sequence[Notice]:
    movement_words, further = ("swings", "swing") if movement == "hip_swing" else ("bows", "bow")
    notices = []
    if done < requested:
        message = (
            Message(
                f"{{segment}}: calibration used {{done}} {plural(done, 'swing', 'swings')}; {{asked}} or "
                "more are recommended.",
                segment=segment,
                done=done,
                asked=requested,
            )
            if movement == "hip_swing"
            else Message(
                f"{{segment}}: calibration used {{done}} {plural(done, 'bow', 'bows')}; {{asked}} or more "
                "are recommended.",
                segment=segment,
                done=done,
                asked=requested,
            )
        )
        notices.append(Notice("few_repetitions", message, sensor=segment))
    if rho < GOOD_AXIS:
        message = Message(
            "{segment}: in the {what} the first principal component explains {rho:.0%} of the movement "
            "(good: {GOOD_AXIS:.0%} or more). Move in one plane.",
            segment=segment,
            what=movement_words,
            rho=rho,
            GOOD_AXIS=GOOD_AXIS,
        )
        notices.append(Notice("not_single_axis", message, sensor=segment))
    if margin < WEAK_MARGIN:
        message = Message(
            "{segment}: forward and backward are hard to distinguish in these {what}; {further} further "
            "forward than back, or declare the placement.",
            segment=segment,
            what=movement_words,
            further=further,
        )
        notices.append(Notice("calibration_sign_weak", message, sensor=segment))
    return notices


def _average(recording: UniformRecording, segments: Sequence[Segment], seconds: float) -> Floats:
    """Mean |ω| (n,) of some sensors over a window around each sample, rad/s."""
    from scipy.ndimage import uniform_filter1d

    rate = np.mean([find_lengths(recording.sensors[s].gyr) for s in segments], axis=0)
    width = max(1, min(round(seconds * recording.rate_hz), len(rate)))
    return np.asarray(uniform_filter1d(rate, width, mode="nearest"))


def _widen(mask: Bools, rate_hz: float) -> Bools:
    """The movement (n,) including its edges, where it begins and ends slowly."""
    wide, edge = mask.copy(), round(EDGE_S * rate_hz)
    for a, b in find_runs(mask):
        wide[max(0, a - edge) : b + edge] = True
    return wide


def _join(mask: Bools, rate_hz: float, params: FunctionalParams) -> Bools:
    """Runs (n,) with breaks of up to `pause_s` closed; only those of at least `shortest_s`."""
    joined = mask.copy()
    for a, b in find_runs(~mask):
        if a > 0 and b < len(mask) and b - a <= params.pause_s * rate_hz:
            joined[a:b] = True
    for a, b in find_runs(joined):
        if b - a < params.shortest_s * rate_hz:
            joined[a:b] = False
    return joined
