"""Steps from one sensor on the trunk: lower back, sacrum or chest, in any orientation.

The trunk is lowest, and its vertical acceleration highest, in double support: the maxima of the smoothed
vertical acceleration are 20 to 70 ms after the initial contacts (mobgap_lowback). With a Gaussian kernel this
is the differentiated vertical velocity of McCamley et al. 2012 (Gait & Posture 36:316). Our addition makes it
robust: kernel width and minimum distance of the maxima follow the step time with which the whole movement
repeats (core/events/periodicity.py), because slow walking has two maxima per step, and without a periodicity
no step is reported.

Side of the step: the pelvis rotates towards the side in front, so its yaw alternates between the contacts. A
thorax rotates against or with the pelvis, depending on speed: a chest sensor cannot determine the side.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np

from sagittal.core.errors import Notice, SignalError
from sagittal.core.events.bouts import Bout, BoutParams, RowParams, plain_bouts, walking_bouts
from sagittal.core.events.periodicity import Periodicity, PeriodicityParams, step_times
from sagittal.core.events.steps import Step, Steps
from sagittal.core.frames import Bools, Floats, Segment, Side
from sagittal.core.message import Message
from sagittal.core.plurals import plural
from sagittal.core.rotation import find_lengths
from sagittal.core.signals.filtering import low_pass, smooth_gaussian
from sagittal.core.signals.peaks import find_peaks
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from sagittal.core.signals.rest import STANDING, find_rest_windows, find_runs

TRUNK: Final[tuple[Segment, ...]] = ("pelvis", "chest")


@dataclass(frozen=True)
class StepTimeParams:
    """Parameters of step detection at the trunk.

    Parameters
    ----------
    scale : σ of the Gaussian as a fraction of the step time: 64 ms at the 0.6 s of mobgap_lowback Test5.
    prominence : minimum prominence of a maximum, m/s². Our choice: standing has 0.1, the most severe
        simulated shuffle 1; values between 0.15 and 0.4 are equivalent on mobgap_lowback (F1 0.94 to 0.95).
    apart : minimum distance of two steps as a fraction of the step time. Our choice: the shorter step of a
        limp of 1 : 1.7 (the worst simulated patient has 1 : 1.4) and the longest gap between two maxima of
        one step.
    up_s : σ of the Gaussian for averaging specific force to find the vertical: several steps.
    moving : std of the vertical acceleration over 1 s that indicates movement, m/s². Our choice: standing has
        at most 0.07 (core/calibration/walking.py).
    merge_s : shorter pauses do not divide the recording into parts with separate step times.
    step_s : range of step times in walking.
    row_steps : minimum number of consecutive maxima; fewer are a shift of weight or an external push. Our
        choice: a stride, three contacts.
    bout_score : minimum mean score of a bout in a recording with walking. Our choice: noise has 0.2, daily
        life with turns and stops (mobgap_lowback Test11) at least 0.29. Slow and irregular walking has down
        to 0.20, but so do sitting down and bowing (qmt_fullbody).
    min_rate_hz : our choice: five samples in the shortest step.
    """

    scale: float = 0.107
    prominence: float = 0.4
    apart: float = 0.6
    up_s: float = 2.0
    moving: float = 0.2
    merge_s: float = 2.0
    step_s: tuple[float, float] = (0.25, 1.3)
    row_steps: int = 3
    min_rate_hz: float = 20.0
    periodicity: PeriodicityParams = field(default_factory=PeriodicityParams)
    bout_score: float = 0.25
    bouts: RowParams = field(default_factory=RowParams)


@dataclass(frozen=True)
class LumbarParams(StepTimeParams):
    """Parameters of step detection with sides.

    Parameters
    ----------
    side_share, side_steps : minimum agreement of the alternating yaw (0 to 1) and minimum number of steps
        without a break to assign sides. Our choice.
    side_rad : minimum mean of the alternating yaw in a straight part judged separately. In two of the four
        people of ipol_walks it alternates by at most 1.2°, in one of them with the opposite sign.
    side_reach : number of steps at the ends of a walk that are assigned along with the adjacent straight
        part. Our choice.
    turning_rad_s : yaw rate below 0.5 Hz that indicates a turn, in which the pelvic rotation cannot be
        separated. Our choice: that of a turn (core/events/turns.py).
    """

    bouts: BoutParams = field(default_factory=BoutParams)
    side_share: float = 0.6
    side_steps: int = 4
    side_rad: float = float(np.radians(1.5))
    side_reach: int = 3
    turning_rad_s: float = float(np.radians(15.0))


def trunk_sensor(recording: UniformRecording) -> Segment | None:
    """The trunk sensor to use, the lower back before the chest."""
    return next((s for s in TRUNK if s in recording.sensors), None)


def detect_steps(recording: UniformRecording, params: LumbarParams | None = None) -> Steps:
    """Steps, their sides where determined, and walking bouts of a recording with a trunk sensor.

    Parameters
    ----------
    recording : with "pelvis" or "chest"; neither rest nor calibration is needed. A sensor without a
        gyroscope has zeros.

    Returns
    -------
    Steps inside walking bouts; without any, a notice `no_walking` (no movement), `non_periodic` (movement
    without a step rhythm) or `few_steps` (no bout).

    Raises
    ------
    SignalError : `no_trunk_sensor`, `sample_rate_too_low`.
    """
    params = params or LumbarParams()
    segment = trunk_sensor(recording)
    if segment is None:
        raise SignalError("no_trunk_sensor", "Trunk steps require a sensor on the pelvis or chest.")
    detection = _find_rows(recording, segment, params)
    if isinstance(detection, Steps):
        return detection
    times, rhythm, yaw_rate = detection
    rests = find_rest_windows(recording, segments=(segment,))
    standing = find_rest_windows(recording, STANDING, (segment,))
    bouts = tuple(
        b
        for b in walking_bouts(times, rests=rests, params=params.bouts, standing=standing)
        if _repeats(b, rhythm, params)
    )
    rate = recording.rate_hz
    if not bouts:
        return _nothing(
            segment,
            "few_steps",
            Message(
                f"{{times}} {plural(len(times), 'step', 'steps')} detected, but never {{min_strides}} "
                "in a row: no walking bout is reported. Record a longer walk.",
                times=len(times),
                min_strides=params.bouts.min_strides + 2,
            ),
        )
    steps = [
        step
        for bout in bouts
        for run in _unbroken([t for t in times if bout.first_s <= t <= bout.end_s], bout)
        for step in _tell_feet(run, segment, yaw_rate, bout.step_s, rate, params)
    ]
    notices = _tell_unknown_sides(steps, segment)
    return Steps(tuple(steps), bouts, segment, notices, {"score": float(rhythm.score.max())})


def _tell_feet(
    run: list[float], segment: Segment, yaw_rate: Floats, step_s: float, rate_hz: float, params: LumbarParams
) -> list[Step]:
    """The steps of an unbroken run with their sides, which only a pelvis sensor determines."""
    sides: list[Side | None] = [None] * len(run)
    if segment == "pelvis":
        sides = _sides(run, yaw_rate, step_s, rate_hz, params)
    return [Step(t, side) for t, side in zip(run, sides, strict=True)]


def _tell_unknown_sides(steps: list[Step], segment: Segment) -> tuple[Notice, ...]:
    if all(s.side is not None for s in steps):
        return ()
    return (
        Notice(
            "side_unknown",
            "Left and right steps cannot "
            + ("be distinguished from the chest." if segment == "chest" else "always be distinguished.")
            + " Step times and cadence do not depend on this.",
            segment,
            severity="info",
        ),
    )


def find_step_times(recording: UniformRecording, segment: Segment, params: StepTimeParams) -> list[float]:
    """Step times of a sensor as in `detect_steps`, without sides and stops.

    Raises
    ------
    SignalError : `sample_rate_too_low`.
    """
    detection = _find_rows(recording, segment, params)
    if isinstance(detection, Steps):
        return []
    times, rhythm, _ = detection
    bouts = [b for b in plain_bouts(times, params.bouts) if _repeats(b, rhythm, params)]
    return [t for b in bouts for t in times if b.first_s <= t <= b.end_s]


def _find_rows(
    recording: UniformRecording, segment: Segment, params: StepTimeParams
) -> Steps | tuple[list[float], Periodicity, Floats]:
    """Times of consecutive steps, s, their rhythm and the yaw rate, rad/s; or empty steps with the reason."""
    rate = recording.rate_hz
    if rate < params.min_rate_hz:
        raise SignalError(
            "sample_rate_too_low",
            Message(
                "Steps need at least {min_rate_hz:g} Hz, the recording has {rate:g} Hz. Record at a "
                "higher rate.",
                min_rate_hz=params.min_rate_hz,
                rate=rate,
            ),
            sensor=segment,
        )
    signals = recording.sensors[segment]
    up, norm = _mean_up(signals, rate, params)
    vertical, yaw_rate = _split_along(signals, up, norm)
    moving = find_moving(vertical, signals.valid, rate, params)
    if not moving.any():
        return _nothing(segment, "no_walking", "The trunk hardly moved: no steps detected.")
    if signals.gyr.any():
        rhythm = step_times(vertical, signals.gyr, rate, params.periodicity)
    else:
        horizontal = signals.acc - (vertical + norm)[:, None] * up
        rhythm = step_times(vertical, None, rate, params.periodicity, horizontal)
    if not rhythm.walks(params.step_s, params.periodicity):
        return _nothing(
            segment,
            "non_periodic",
            Message(
                "Trunk movement has no step rhythm (best score {max:.2f}; {row_score:g} required for several "
                "seconds): no steps are reported. Record at least ten steps straight ahead.",
                max=rhythm.score.max(),
                row_score=params.periodicity.row_score,
            ),
        )
    return _steps(vertical, moving, rhythm, rate, params), rhythm, yaw_rate


def split_about_vertical(
    signals: SensorSignals, rate_hz: float, params: StepTimeParams | None = None
) -> tuple[Floats, Floats]:
    """Gravity-free vertical acceleration (n,) in m/s² and yaw rate (n,) in rad/s, left positive.

    Up is the mean direction of the specific force over several steps: an upright trunk needs no filter.
    """
    return _split_along(signals, *_mean_up(signals, rate_hz, params or StepTimeParams()))


def _split_along(signals: SensorSignals, up: Floats, norm: Floats) -> tuple[Floats, Floats]:
    return np.einsum("ni,ni->n", signals.acc, up) - norm, np.einsum("ni,ni->n", signals.gyr, up)


def _mean_up(signals: SensorSignals, rate_hz: float, params: StepTimeParams) -> tuple[Floats, Floats]:
    """Up direction (n, 3) in sensor axes, and the mean specific force (n,) along it, m/s²."""
    force = np.stack([smooth_gaussian(a, params.up_s * rate_hz) for a in signals.acc.T], axis=1)
    norm = np.maximum(find_lengths(force), 1e-9)
    return force / norm[:, None], norm


def find_moving(vertical: Floats, valid: Bools, rate_hz: float, params: StepTimeParams) -> Bools:
    """Samples with walking-like vertical movement of the trunk and sensor data available."""
    from scipy.ndimage import uniform_filter1d

    width = max(2, round(rate_hz))
    mean = uniform_filter1d(vertical, width, mode="nearest")
    spread = uniform_filter1d(vertical**2, width, mode="nearest") - mean**2
    return np.asarray((spread > params.moving**2) & valid)


def _good(rhythm: Periodicity, params: StepTimeParams) -> Bools:
    low, high = params.step_s
    in_range = (rhythm.step_s >= low) & (rhythm.step_s <= high)
    return np.asarray(in_range & (rhythm.score >= params.periodicity.least))


def _steps(
    vertical: Floats, moving: Bools, rhythm: Periodicity, rate_hz: float, params: StepTimeParams
) -> list[float]:
    """Times of the maxima in every moving part, with a kernel for the step time of that part."""
    good = _good(rhythm, params)
    usual = float(np.median(rhythm.step_s[good]))
    times: list[float] = []
    for first, end in _parts(moving, params.merge_s * rate_hz):
        mask = good & (rhythm.t_s * rate_hz >= first) & (rhythm.t_s * rate_hz <= end)
        step = float(np.median(rhythm.step_s[mask])) if mask.any() else usual
        reach = round(2.0 * step * rate_hz)
        low = max(0, first - reach)
        smooth = smooth_gaussian(vertical[low : end + reach], params.scale * step * rate_hz)
        peaks = find_peaks(smooth, prominence=params.prominence, distance=params.apart * step * rate_hz)
        inside = [int(p) for p in peaks + low if first <= p < end and moving[p]]
        row = [float(p + _offset(smooth, p - low)) / rate_hz for p in inside]
        times += _together(row, params.bouts.long_share * step, params.row_steps)
    return times


def _repeats(bout: Bout, rhythm: Periodicity, params: StepTimeParams) -> bool:
    """Whether a bout is sufficiently periodic."""
    reach = 0.5 * params.periodicity.hop_s
    mask = (rhythm.t_s >= bout.start_s - reach) & (rhythm.t_s <= bout.end_s + reach)
    return bool(mask.any() and rhythm.score[mask].mean() >= params.bout_score)


def _parts(moving: Bools, merge: float) -> list[tuple[int, int]]:
    """Runs of movement, merged if closer than `merge` samples."""
    parts: list[tuple[int, int]] = []
    for first, end in find_runs(moving):
        if parts and first - parts[-1][1] < merge:
            parts[-1] = (parts[-1][0], end)
        else:
            parts.append((first, end))
    return parts


def _offset(x: Floats, i: int) -> float:
    """Sub-sample offset of the maximum, within ±0.5: a parabola through three samples."""
    bend = x[i - 1] - 2.0 * x[i] + x[i + 1]
    return 0.0 if bend >= 0.0 else float(0.5 * (x[i - 1] - x[i + 1]) / bend)


def _together(times: list[float], longest: float, least: int) -> list[float]:
    """Times in a row of at least `least`, with gaps of at most `longest`."""
    steady_times: list[float] = []
    row: list[float] = []
    for t in times:
        if row and t - row[-1] > longest:
            steady_times += row if len(row) >= least else []
            row = []
        row.append(t)
    return steady_times + (row if len(row) >= least else [])


def _unbroken(times: list[float], bout: Bout) -> list[list[float]]:
    """Steps of a bout between its breaks."""
    ends = {a for a, _ in bout.breaks}
    rows: list[list[float]] = [[]]
    for t in times:
        rows[-1].append(t)
        if t in ends:
            rows.append([])
    return rows


def _sides(
    times: list[float], yaw_rate: Floats, step_s: float, rate_hz: float, params: LumbarParams
) -> list[Side | None]:
    """Side of each step, None where the yaw is inconclusive.

    The yaw relative to its mean over a stride is left (positive) when the right foot is in front, with its
    maximum about an eighth of a stride after the contact: between the simulator's pelvis (at the contact) and
    real ones (0.1 to 0.2 s after it in mobgap_lowback and neura_walk). In a turn it is meaningless and a step
    is easily missed: if the whole walk is inconsistent, every straight part is judged separately, and steps
    in a turn are assigned if the adjacent parts agree.
    """
    from scipy.ndimage import uniform_filter1d

    yaw = np.cumsum(yaw_rate) / rate_hz
    stride = max(3, round(2.0 * step_s * rate_hz))
    swing = yaw - uniform_filter1d(uniform_filter1d(yaw, stride, mode="nearest"), stride, mode="nearest")
    n = len(times)
    yaw_at_step = swing[[min(len(swing) - 1, round((t + 0.25 * step_s) * rate_hz)) for t in times]]
    turning = np.abs(low_pass(yaw_rate, 0.5, rate_hz)) >= params.turning_rad_s
    straight = ~turning[[min(len(swing) - 1, round(t * rate_hz)) for t in times]]
    # where a maximum was missed, two steps went by
    gone = np.maximum(1, np.round(np.diff(times) / step_s)).astype(int)
    parity = (-1.0) ** np.concatenate(([0], np.cumsum(gone)))
    agreement = float((yaw_at_step * parity).sum() / max(np.abs(yaw_at_step).sum(), 1e-12))
    if n >= params.side_steps and abs(agreement) >= params.side_share:
        return ["right" if p * agreement > 0.0 else "left" for p in parity]
    right = np.zeros(n)
    parts = [(a, b) for a, b in find_runs(straight) if b - a >= params.side_steps]
    for a, b in parts:
        total = float((yaw_at_step[a:b] * parity[a:b]).sum())
        share = abs(total) / max(float(np.abs(yaw_at_step[a:b]).sum()), 1e-12)
        if share >= params.side_share and abs(total) >= params.side_rad * (b - a):
            low = 0 if a <= params.side_reach else a
            high = n if n - b <= params.side_reach else b
            right[low:high] = np.sign(total) * parity[low:high]
    for (_, a), (b, _) in pairwise(parts):
        # the same order of feet before and after: no step was missed between
        if right[a - 1] * parity[a - 1] * right[b] * parity[b] > 0.0:
            right[a:b] = right[b] * parity[b] * parity[a:b]
    return ["right" if x > 0.0 else "left" if x < 0.0 else None for x in right]


def _nothing(segment: Segment, code: str, message: str) -> Steps:
    return Steps((), (), segment, (Notice(code, message, segment),))
