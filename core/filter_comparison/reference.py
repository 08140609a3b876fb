"""Alignment of an external reference with a recording: clock offset, world frame, and marker orientation.

Three quantities are fitted and reported because no file contains them. The lag: where the angular speeds,
which are independent of frames, correlate best. And per segment one constant rotation of the world and one of
the sensor, relative to the median of the filters: errors common to all filters are therefore invisible, and
filters near the median appear better than others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.signal import correlate

from sagittal.core.angles.kernel import AngleKernel
from sagittal.core.errors import FormatError, Notice
from sagittal.core.filter_comparison.result import BlandAltman
from sagittal.core.formats.aliases import segment_named
from sagittal.core.formats.orientation_table import OrientationTable
from sagittal.core.frames import SEGMENTS, Bools, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.rotation import conjugate, log, mean, multiply, normalise, rotate, wrap_angle, yaw

LEAST_OVERLAP_S: Final = 5.0
"""Shortest stretch on which a lag is looked for (our choice: some strides)."""
LONGEST_S: Final = 3 * 3600.0
"""Longest reference (our choice): beyond it a clock in ms or µs was most likely read as seconds."""
LEAST_SHARE: Final = 0.5
"""Share of the shorter of both that has to meet the other."""
LEAST_CORRELATION: Final = 0.7
"""Of angular speeds; the same movement gives 0.9 and more, another walk at the same pace about 0.5."""
NEAR_S: Final = 0.5
NEAR_ENOUGH: Final = 0.02
"""The file's own clock is believed to within `NEAR_S` when no other lag correlates better by this much: a
walk looks the same a stride later."""
GAP_S: Final = 0.1
FITTED: Final = 4000
"""Samples that the constant turns are fitted to at most."""
ROUNDS: Final = 30
"""Of the fit, which settles in less than ten."""
POINTS: Final = 80
"""Of a Bland–Altman plot."""


@dataclass(frozen=True, eq=False)
class PlacedReference:
    """A reference in W, by segment: segment → (m, 4) at the compared samples, NaN where unknown."""

    q: Mapping[Segment, Floats]
    lag_s: float
    correlation: float
    notices: tuple[Notice, ...]


def place_reference(
    table: OrientationTable,
    devices: Mapping[str, Segment | None],
    median: Mapping[Segment, Floats],
    valid: Mapping[Segment, Bools],
    t_s: Floats,
) -> PlacedReference:
    """Align a reference with a recording.

    Parameters
    ----------
    devices : device → segment, for columns named by sensor. median : segment → (m, 4) segment to W, median of
        the filters. t_s : (m,) uniform.

    Raises
    ------
    FormatError `no_common_segment`, `too_long`, `no_overlap`, `other_movement`.
    """
    named = name_segments(table, devices)
    common = [s for s in SEGMENTS if s in named and s in median]
    _check_reference(table, common, median)
    step = float(t_s[1] - t_s[0])
    own_t = np.arange(table.t_s[0], table.t_s[-1], step)
    pairs = [
        (
            np.where(valid[s][1:] & valid[s][:-1], _speed(median[s]), np.nan),
            _speed(interpolate(own_t, table.t_s, named[s])),
        )
        for s in common
    ]
    lag_s, correlation = find_lag(pairs, step, float(t_s[0] - own_t[0]), table.source)
    q = {}
    for s in common:
        interpolated = interpolate(t_s - lag_s, table.t_s, named[s])
        samples = np.flatnonzero(np.isfinite(interpolated[:, 0]) & valid[s])
        if len(samples) * step < LEAST_OVERLAP_S:
            continue
        samples = samples[:: -(-len(samples) // FITTED)]
        world, sensor = fit_frames(interpolated[samples], median[s][samples])
        q[s] = multiply(multiply(conjugate(world), interpolated), conjugate(sensor))
    return PlacedReference(q, lag_s, correlation, _tell_placing(lag_s, correlation))


def _check_reference(
    table: OrientationTable, common: Sequence[Segment], median: Mapping[Segment, Floats]
) -> None:
    if not common:
        raise FormatError(
            "no_common_segment",
            Message(
                "{source} has {join}, the take {median}. Name columns by segments or by sensor ids "
                "of this take.",
                source=table.source,
                join=", ".join(list(table.q)[:8]),
                median=", ".join(median),
            ),
        )
    lasts_s = float(table.t_s[-1] - table.t_s[0])
    if lasts_s > LONGEST_S:
        raise FormatError(
            "too_long",
            Message(
                "{source} lasts {lasts_s:.6g} s by its time; expected at most {LONGEST_S:g} s. A "
                "column in ms or µs says so in its name: time_ms, time_us.",
                source=table.source,
                lasts_s=lasts_s,
                LONGEST_S=LONGEST_S,
            ),
        )
    if lasts_s < LEAST_OVERLAP_S:
        raise _too_short(table.source)


def _tell_placing(lag_s: float, correlation: float) -> tuple[Notice, ...]:
    """Notices on the fitted alignment of the reference."""
    return (
        Notice(
            "reference_lag",
            Message(
                f"The reference's clock was moved {'back' if lag_s < 0.0 else 'on'} by {{lag_s:.3f}} "
                "s, where the angular speeds correlate best ({correlation:.3f}).",
                lag_s=abs(lag_s),
                correlation=correlation,
            ),
            severity="info",
        ),
        Notice(
            "reference_turned",
            "For each segment, one constant rotation of the world frame and one of the sensor frame were "
            "fitted to the median of the filters. A constant error common to all filters is not visible. "
            "Filters near the median appear better: differences below about one degree do not rank "
            "filters.",
            severity="info",
        ),
    )


def name_segments(table: OrientationTable, assignment: Mapping[str, Segment | None]) -> dict[Segment, Floats]:
    """Columns of the reference by segment, named by the segment or by its sensor."""
    devices = {device.lower(): segment for device, segment in assignment.items()}
    columns: dict[Segment, Floats] = {}
    for name, q in table.q.items():
        segment = devices.get(name.lower()) or segment_named(name)
        if segment is not None:
            columns.setdefault(segment, q)
    return columns


def interpolate(t_new: Floats, t_s: Floats, q: Floats) -> Floats:
    """Orientations (k, 4) at other times; NaN outside the range, and in gaps longer than 0.1 s or two
    samples.
    """
    is_known = np.isfinite(q[:, 0])
    t, x = t_s[is_known], q[is_known]
    out = np.full((len(t_new), 4), np.nan)
    if len(t) < 2:
        return out
    flips = np.sign((x[1:] * x[:-1]).sum(axis=1))
    x = x * np.concatenate(([1.0], np.cumprod(np.where(flips == 0.0, 1.0, flips))))[:, None]
    longest = max(GAP_S, 2.1 * float(np.median(np.diff(t_s))))
    previous = np.clip(np.searchsorted(t, t_new, "right") - 1, 0, len(t) - 2)
    inside = (t_new >= t[0]) & (t_new <= t[-1]) & (t[previous + 1] - t[previous] <= longest)
    out[inside] = normalise(np.stack([np.interp(t_new[inside], t, x[:, c]) for c in range(4)], axis=1))
    return out


def find_lag(
    pairs: Sequence[tuple[Floats, Floats]], step_s: float, ahead_s: float, source: str
) -> tuple[float, float]:
    """Offset to add to the reference's clock, s, and the correlation of the angular speeds with it.

    Parameters
    ----------
    pairs : by segment the speeds of the recording (m,) and of the reference (k,), NaN where unknown, both
        every `step_s`. ahead_s : delay of the recording's first sample by the two clocks.

    Raises
    ------
    FormatError `no_overlap`, `other_movement`.
    """
    covariance, left, right, overlap = (np.zeros(1) for _ in range(4))
    for take, reference in pairs:
        (a, take_known), (b, reference_known) = (_known(x) for x in (take, reference))
        n = np.maximum(_meet(take_known, reference_known), 1.0)
        mean_a, mean_b = _meet(a, reference_known) / n, _meet(take_known, b) / n
        covariance = covariance + _meet(a, b) - n * mean_a * mean_b
        left = left + _meet(a**2, reference_known) - n * mean_a**2
        right = right + _meet(take_known, b**2) - n * mean_b**2
        overlap = np.maximum(overlap, n)
    shorter = min(len(x) for x in pairs[0])
    enough = overlap >= max(LEAST_OVERLAP_S / step_s, LEAST_SHARE * shorter)
    if not enough.any():
        raise _too_short(source)
    power = np.sqrt(np.maximum(left, 0.0) * np.maximum(right, 0.0))
    r = np.where(enough & (power > 1e-12 * power.max()), covariance / np.where(power > 0.0, power, 1.0), -1.0)
    # sample k of the take meets sample k − shift of the reference
    lags = (np.arange(len(r)) - (len(pairs[0][1]) - 1)) * step_s + ahead_s
    best = int(np.argmax(r))
    near = np.where(np.abs(lags) <= NEAR_S, r, -1.0)
    if near.max() >= r[best] - NEAR_ENOUGH:
        best = int(np.argmax(near))
    if r[best] < LEAST_CORRELATION:
        raise FormatError(
            "other_movement",
            Message(
                "{source} moves differently from the take: angular speeds correlate by {best:.2f} "
                "at best, expected {LEAST_CORRELATION:g}. Is it of this take, and are the segments "
                "right?",
                source=source,
                best=r[best],
                LEAST_CORRELATION=LEAST_CORRELATION,
            ),
        )
    a, b, c = r[max(best - 1, 0)], r[best], r[min(best + 1, len(r) - 1)]
    bend = a - 2.0 * b + c
    return float(lags[best] + (0.5 * step_s * (a - c) / bend if bend < 0.0 else 0.0)), float(b)


def _too_short(source: str) -> FormatError:
    return FormatError(
        "no_overlap",
        Message(
            "“{source}” and the trial overlap by less than {LEAST_OVERLAP_S:g} s; provide the complete "
            "reference.",
            source=source,
            LEAST_OVERLAP_S=LEAST_OVERLAP_S,
        ),
    )


def fit_frames(reference: Floats, q: Floats) -> tuple[Floats, Floats]:
    """Constant rotations a, b (4,) with reference ≈ a ⊗ q ⊗ b over samples (k, 4), least squares of sines.

    ⟨reference, a q b⟩ is linear in a bᵀ: the largest eigenvector of its square gives initial values, refined
    by alternating mean rotations (Markley 2007) of one given the other until convergence.
    """
    basis = np.eye(4)
    parts = [(multiply(multiply(a, q), b) * reference).sum(axis=1) for a in basis for b in basis]
    linear = np.stack(parts, axis=1)
    left, _, right = np.linalg.svd(np.linalg.eigh(linear.T @ linear)[1][:, -1].reshape(4, 4))
    world, sensor = normalise(left[:, 0]), normalise(right[0])
    for _ in range(ROUNDS):
        world = mean(multiply(reference, conjugate(multiply(q, sensor))))
        sensor = mean(multiply(conjugate(multiply(world, q)), reference))
    return world, sensor


def measure_reference_angles(
    q: Mapping[Segment, Floats], is_known: Mapping[Segment, Bools], zero_offset: Mapping[str, float]
) -> dict[str, Floats]:
    """Joint angles (m,) of an aligned reference with the zero of the recording, so it need not include
    standing.

    Parameters
    ----------
    zero_offset : angle → offset to subtract, rad; angles without one are omitted.
    """
    kernel = AngleKernel.between(tuple(q))
    zero = np.array([zero_offset.get(name, np.nan) for name in kernel.names])
    angles = kernel.measure(np.stack([*q.values()], axis=1), np.stack([is_known[s] for s in q], axis=1), zero)
    return {name: angles[:, i] for i, name in enumerate(kernel.names) if name in zero_offset}


def compare_by_bland_altman(
    name: str | None, quantity: str, value: Floats, reference: Floats
) -> BlandAltman | None:
    """Bland–Altman statistics of angles (m,) in rad where both are known; None with fewer than two."""
    is_known = np.isfinite(value) & np.isfinite(reference)
    if np.count_nonzero(is_known) < 2:
        return None
    apart = wrap_angle(value[is_known] - reference[is_known])
    bias, sd = float(apart.mean()), float(apart.std(ddof=1))
    points = np.linspace(0, len(apart) - 1, min(POINTS, len(apart))).round().astype(np.int64)
    return BlandAltman(
        name, quantity, len(apart), bias, bias - 1.96 * sd, bias + 1.96 * sd,
        float(np.sqrt((apart**2).mean())),
        wrap_angle(reference[is_known][points] + 0.5 * apart[points]), apart[points],
    )  # fmt: skip


def lean_and_course(q: Floats) -> tuple[Floats, Floats]:
    """Inclination (m,) of a segment's long axis and its heading, rad; NaN where q is."""
    up = rotate(q, np.array([0.0, 1.0, 0.0]))[..., 2]
    return np.arccos(np.clip(up, -1.0, 1.0)), yaw(q)


def _speed(q: Floats) -> Floats:
    """Rotation angle between consecutive samples (m − 1,), rad."""
    return np.asarray(np.linalg.norm(log(multiply(conjugate(q[:-1]), q[1:])), axis=1))


def _known(x: Floats) -> tuple[Floats, Floats]:
    """The signal with unknown samples set to zero, and its validity as 0 or 1."""
    is_known = np.isfinite(x)
    return np.where(is_known, x, 0.0), is_known.astype(np.float64)


def _meet(a: Floats, b: Floats) -> Floats:
    """Cross-correlation sums of two signals at every lag."""
    return np.asarray(correlate(a, b, method="fft"))
