"""A sensor that slips on its segment: which, when, by how much about the axis across.

The joints next to a sensor lie where they lie in its axes, whatever the gait or posture. A slip turns
them all by one rotation (the judge). Strides, each by itself, show when, and do not deny it (the witness): a
change of gait turns those too, so that alone they are no proof.
Equations: docs/science/agreement.md, "Slipped sensors".
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from core.agreement.lags import MAD
from core.agreement.params import SlipParams
from core.agreement.strides import choose_leg, find_main_axis, find_stride_turns, find_swings
from core.agreement.terms import SensorTerms
from core.agreement.windows import JointWindows
from core.frames import Bools, Floats, Segment
from core.recording import UniformRecording

INDEPENDENT: Final = 5.0
"""More windows side by side than this do not make a median surer: gait changes between them too."""

DOUBT: Final = 2.0
"""Another sensor's turn counts beyond so many times its own scatter."""

FINEST_S: Final = 0.5
LIKELY: Final = 0.5
"""Moments at which even the means differ by less than this share of the smallest slip are passed over."""

REPAIRED: Final = "shank"
"""Segments whose slip is turned back: the angle from two joints is right to a degree there."""


@dataclass(frozen=True)
class SensorSlip:
    """A slip of one sensor.

    Parameters
    ----------
    at_s, within_s : when, and half the width of what is left out. turn_rad : about `axis` (3,) in sensor
        axes: what the sensor shows afterwards = that turn of what it would have shown. sd_rad : of it.
    """

    segment: Segment
    at_s: float
    within_s: float
    turn_rad: float
    sd_rad: float
    axis: tuple[float, float, float]

    @property
    def is_repaired(self) -> bool:
        """Whether what follows is turned back."""
        return self.segment.startswith(REPAIRED)


@dataclass(frozen=True, eq=False)
class PlaceTurns:
    """Turn of the joints' places about the axis across, window by window.

    Parameters
    ----------
    t_s, turn : (m,) s, rad. places : (m, joints, 3) across the axis, turned back, m.
    """

    t_s: Floats
    turn: Floats
    places: Floats


@dataclass(frozen=True)
class _Step:
    at_s: float
    size: float
    z: float
    sd: float


def find_slips(
    recording: UniformRecording,
    terms: Mapping[Segment, SensorTerms],
    joints: Sequence[JointWindows],
    params: SlipParams,
) -> tuple[SensorSlip, ...]:
    """The slips that pass all limits, at most one a sensor.

    Parameters
    ----------
    terms, joints : of a recording whose late sensors were shifted.
    """
    rate_hz = recording.rate_hz
    moving = [_find_moving(w, terms, rate_hz, params) for w in joints]
    axes: dict[Segment, Floats] = {s: find_main_axis(x.rate) for s, x in terms.items() if s != "pelvis"}
    turns: dict[Segment, PlaceTurns] = {
        s: x for s, axis in axes.items() if (x := _find_place_turns(s, joints, moving, axis, params))
    }
    half = 0.5 * max((w.width_s for w in joints), default=0.0)
    slips = []
    for segment, found in turns.items():
        step = _find_best_step(found, half, params)
        if step is None or not _is_alone(segment, step, turns, half, params):
            continue
        if _measure_misfit(found, step, half) >= params.misfit:
            continue
        slip = _question_strides(segment, step, axes[segment], recording, terms, half, params)
        if slip is not None:
            slips.append(slip)
    return tuple(slips)


def _find_moving(
    w: JointWindows, terms: Mapping[Segment, SensorTerms], rate_hz: float, params: SlipParams
) -> Bools:
    """Windows (m,) in which the leg sensors of a joint swing as in walking, and the joint fits."""
    ok = w.residual < params.worst_residual
    for s in (w.first, w.second):
        if s == "pelvis":
            continue
        power = np.concatenate(([0.0], np.cumsum((terms[s].rate ** 2).sum(axis=1))))
        a, b = (
            np.clip(np.round((w.t_s + x * w.width_s) * rate_hz).astype(int), 0, len(power) - 1)
            for x in (-0.5, 0.5)
        )
        ok &= (power[b] - power[a]) > params.least_swing**2 * np.maximum(b - a, 1)
    return np.asarray(ok, np.bool_)


def _find_place_turns(
    segment: Segment,
    joints: Sequence[JointWindows],
    moving: Sequence[Bools],
    axis: Floats,
    params: SlipParams,
) -> PlaceTurns | None:
    """Turns of the places from where they typically lie, of windows in which all its joints speak."""
    own = [(w.choose(ok)) for w, ok in zip(joints, moving, strict=True) if segment in (w.first, w.second)]
    # one joint alone says too little, except at a foot, which has no other
    if not own or (len(own) < 2 and not segment.startswith("foot")):
        return None
    t = own[0].t_s
    for w in own[1:]:
        t = np.intersect1d(t, w.t_s)
    if len(t) < 2 * params.least_windows:
        return None
    V = np.stack([w.place_in(segment)[np.isin(w.t_s, t)] for w in own], axis=1)
    V = V - (V @ axis)[:, :, None] * axis
    turn = np.zeros(len(t))
    back = V
    for _ in range(2):
        typical = np.median(back, axis=0)
        turn = np.arctan2((np.cross(typical, V) @ axis).sum(axis=1), np.einsum("mjc,jc->m", V, typical))
        c, s = np.cos(turn)[:, None, None], np.sin(turn)[:, None, None]
        back = c * V - s * np.cross(axis, V)
    return PlaceTurns(t, np.unwrap(turn), back)


def _measure_step(
    found: PlaceTurns, at_s: float, half: float, floor: float, reach: float = np.inf
) -> tuple[float, float] | None:
    """Turn between windows wholly before and wholly after a moment, and its standard deviation."""
    before = (found.t_s <= at_s - half) & (found.t_s >= at_s - reach)
    after = (found.t_s >= at_s + half) & (found.t_s <= at_s + reach)
    if not before.any() or not after.any():
        return None
    parts = [found.turn[before], found.turn[after]]
    middles = [float(np.median(x)) for x in parts]
    spread = max(MAD * float(np.median(np.abs(x - m))) for x, m in zip(parts, middles, strict=True))
    step = float(np.median(np.diff(found.t_s)))
    free = [float(np.clip(len(x) * step / (2 * half), 1.0, INDEPENDENT)) for x in parts]
    return middles[1] - middles[0], float(max(spread, floor) * np.sqrt(sum(1.0 / n for n in free)))


def _find_best_step(found: PlaceTurns, half: float, params: SlipParams) -> _Step | None:
    """The moment before and after which the places differ most clearly, for good; None below the limits."""
    best, most = None, 0.0
    least = params.least_windows
    first, last = found.t_s[least - 1] + half, found.t_s[-least] - half
    moments = np.arange(first, last + 0.01, max(FINEST_S, 0.5 * float(np.median(np.diff(found.t_s)))))
    for at in moments[_is_likely(found, moments, half, LIKELY * params.least_rad)]:
        measured = _measure_step(found, float(at), half, params.floor_rad, params.near_s)
        lasting = _measure_step(found, float(at), half, params.floor_rad)
        if measured is None or lasting is None or lasting[0] / measured[0] < params.lasting:
            continue
        size, sd = measured
        z = abs(size) / sd
        if z * abs(size) > most:
            best, most = _Step(float(at), size, z, sd), z * abs(size)
    if best is None or abs(best.size) <= params.least_rad or best.z <= params.z:
        return None
    return replace(best, at_s=_find_moment(found, best, half, moments, params))


def _find_moment(found: PlaceTurns, step: _Step, half: float, moments: Floats, params: SlipParams) -> float:
    """When the turn was: windows that contain it show a share of it, so that it is a ramp of their width."""
    best, least = step.at_s, np.inf
    near = np.abs(found.t_s - step.at_s) <= params.near_s
    t, x = found.t_s[near], found.turn[near]
    for at in moments[np.abs(moments - step.at_s) <= 0.5 * params.near_s]:
        before, after = x[t <= at - half], x[t >= at + half]
        if not len(before) or not len(after):
            continue
        share = np.clip((t - at + half) / (2.0 * half), 0.0, 1.0)
        ramp = np.median(before) + share * (np.median(after) - np.median(before))
        left = float(np.abs(x - ramp).sum())
        if left < least:
            best, least = float(at), left
    return best


def _is_likely(found: PlaceTurns, moments: Floats, half: float, least: float) -> Bools:
    """Moments at which the mean turn before and after differs by more than least: quick to tell."""
    total = np.concatenate(([0.0], np.cumsum(found.turn)))
    a = np.searchsorted(found.t_s, moments - half + 1e-9)
    b = np.searchsorted(found.t_s, moments + half - 1e-9)
    n = len(found.turn)
    after = (total[n] - total[b]) / np.maximum(n - b, 1)
    return np.asarray(np.abs(after - total[a] / np.maximum(a, 1)) > least, np.bool_)


def _is_alone(
    segment: Segment, step: _Step, turns: Mapping[Segment, PlaceTurns], half: float, params: SlipParams
) -> bool:
    """Whether the other sensors stay where they are at that moment; a change of gait turns several."""
    others = []
    for other, found in turns.items():
        if other == segment:
            continue
        measured = _measure_step(found, step.at_s, half, params.floor_rad, params.near_s)
        if measured is not None:
            others.append(max(0.0, abs(measured[0]) - DOUBT * measured[1]))
    return len(others) > 1 and max(others) < params.alone * abs(step.size)


def _measure_misfit(found: PlaceTurns, step: _Step, half: float) -> float:
    """What a turn does not carry from before to after, of the size of the places."""
    before = np.median(found.places[found.t_s <= step.at_s - half], axis=0)
    after = np.median(found.places[found.t_s >= step.at_s + half], axis=0)
    size = 0.5 * float(np.linalg.norm(before) + np.linalg.norm(after))
    return float(np.linalg.norm(before - after) / max(size, 1e-9))


def _question_strides(
    segment: Segment,
    step: _Step,
    axis: Floats,
    recording: UniformRecording,
    terms: Mapping[Segment, SensorTerms],
    half: float,
    params: SlipParams,
) -> SensorSlip | None:
    """What single strides say of it: when it was, None where they deny it or it is too small without them."""
    rate_hz, at, within = recording.rate_hz, step.at_s, half
    share = None
    for leg in choose_leg(segment):
        borders = find_swings(terms[leg].rate, rate_hz) if leg in terms else np.zeros(0)
        if len(borders) > 2 * params.strides:
            u = find_stride_turns(terms[segment], recording.sensors[segment].valid, borders, rate_hz, params)
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
                    best, share, at = left, got / step.size, float(when)
                    within = 0.5 * float(u.start_s[k] - u.end_s[k - 1]) + 0.6 + abs(at - step.at_s)
            break
    witnessed = share is not None and share >= params.agree
    if not witnessed:
        at, within = step.at_s, half
        clear = abs(step.size) > params.sure_rad and step.z > 2.0 * params.z
        if share is not None and not clear:
            return None
    if abs(step.size) <= params.least_rad + (0.0 if witnessed else params.unwitnessed_rad):
        return None
    along = tuple(float(v) for v in axis)
    return SensorSlip(segment, at, max(within, params.within_s), step.size, step.sd, along)  # type: ignore[arg-type]
