"""Paths of the feet and strides → distances: lengths, width, speed, swing paths.

The position of a foot is that of its ankle at foot-flat (flats.py). Stride length and speed are between two
foot-flats of one foot, over the same window (docs/science/spatial.md); a step is between foot-flats of the
two feet and belongs to the foot that lands. The direction of progression of a stride is from its first
foot-flat to its second.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import atan2, hypot
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.body.feet import FootTracks
from sagittal.core.events.result import Strides
from sagittal.core.frames import Bools, Floats, Protocol, Side
from sagittal.core.parameters.catalogue import list_names
from sagittal.core.parameters.catalogue.entry import DISTANCES
from sagittal.core.parameters.clearance import (
    SoleHeights,
    lay_out,
    measure_floor_heights,
    sole_heights,
    toe_clearance,
)
from sagittal.core.parameters.flats import OTHER, Flats, find_flats
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.rows import (
    Codes,
    Figure,
    Figures,
    figure_parameter,
    side_parameters,
    tell_figure,
)
from sagittal.core.parameters.variability import summarise_values
from sagittal.core.rotation import wrap_angle, yaw
from sagittal.core.signals.held_samples import give_pages_back
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.signals.rest import find_runs

NAMES: Final[tuple[str, ...]] = (*list_names(DISTANCES, scope="stride"), "toe_out_deg")
"""Per-side parameters in the order of the tables."""

STEP_M: Final = 0.05
"""Two rests of a foot closer than this are one place (our choice: below the error of a stride)."""

AT_ONCE: Final = 512
"""Strides after which the paths are let go of."""

CLEARANCES: Final = ("max_heel_clearance_m", "min_toe_clearance_m")


@dataclass(frozen=True)
class Surface:
    """Walking surface.

    Parameters
    ----------
    belt_speed_mps : of a treadmill, None if not entered or overground.
    """

    protocol: Protocol = "walk"
    belt_speed_mps: float | None = None


GROUND: Final = Surface()


def surface_of(recording: UniformRecording) -> Surface:
    """Walking surface according to the recording."""
    return Surface(recording.protocol, recording.belt_speed_mps)


def measure_distances(
    strides: Strides, feet: FootTracks | None, surface: Surface = GROUND, flats: Flats | None = None
) -> Figures:
    """Distances by name for every stride of the list, counted or not, in its order.

    Parameters
    ----------
    feet : None without a foot sensor. flats : from `find_flats`, if already computed.

    Returns
    -------
    Values in m, m/s and degrees: circumduction outward positive, width positive with the feet on their own
    sides, toe-out external positive at the foot-flat that begins the stride, relative to its direction in
    standing for calibration. On a treadmill only length and speed, from the belt speed. Width requires the
    distance of the feet in standing: without it, calibration assumes vertical legs, which is wrong by up to a
    decimetre.
    """
    if surface.protocol == "treadmill":
        return _on_belt(strides, surface.belt_speed_mps)
    values = np.full((len(NAMES), len(strides.strides)), np.nan)
    reasons = np.full(values.shape, "no_foot_track", object)
    if feet is not None:
        flats = find_flats(strides, feet) if flats is None else flats
        for side in feet.p:
            own = strides.columns.of[side]
            if not len(own):
                continue
            foot = _lay_foot(feet, side)
            for first in range(0, len(own), AT_ONCE):
                part = own[first : first + AT_ONCE]
                reasons[:, part] = _explain(flats.select(part), feet, foot)
                part = part[reasons[0, part] == ""]
                if len(part):
                    measured = _measure_side(strides, part, flats.select(part), feet, foot)
                    for i, name in enumerate(NAMES):
                        values[i, part], reasons[i, part] = measured[name].values, measured[name].reasons
                give_pages_back(path for s in feet.p for path in (feet.p[s], feet.q[s]))
    return {name: Figure(*pair) for name, *pair in zip(NAMES, values, reasons, strict=True)}


def in_place(
    strides: Strides, feet: FootTracks | None, surface: Surface = GROUND, flats: Flats | None = None
) -> NDArray[np.intp]:
    """Indices of strides in place, which end where they began: a shift of weight without walking.

    Empty on a treadmill, where this applies to every stride. Arguments as in `measure_distances`.
    """
    short = np.zeros(len(strides.strides), np.bool_)
    if feet is None or surface.protocol == "treadmill":
        return np.flatnonzero(short)
    flats = find_flats(strides, feet) if flats is None else flats
    moved = (flats.first >= 0) & (flats.last > flats.first)
    for side in feet.p:
        own = strides.columns.of[side]
        own = own[moved[own]]
        short[own] = _way(feet.p[side], flats.first[own], flats.last[own])[2] < STEP_M
    return np.flatnonzero(short)


def summarise_distances(
    strides: Strides, feet: FootTracks | None, figures: Figures, surface: Surface = GROUND
) -> tuple[Parameter, ...]:
    """Distances over the counted strides: speed and total distance of the recording, the others by side.

    Returns
    -------
    Parameters; without a value a reason: "no_strides", "estimator_bad" (both feet are suppressed), "path_bad"
    (this foot is) or the most frequent one of the strides.
    """
    speed, *foot_names = NAMES
    return (
        figure_parameter(speed, None, figures[speed], strides.columns.counted),
        _total(feet, surface),
        *side_parameters(strides, {name: figures[name] for name in foot_names}),
    )


def _total(feet: FootTracks | None, surface: Surface) -> Parameter:
    """Total distance of the recording: from rest to rest of a foot, including turns and short steps; mean
    of the feet.
    """
    name = "total_distance_m"
    if surface.protocol == "treadmill":
        return summarise_values(name, None, [], "m", "treadmill")
    if feet is None:
        return summarise_values(name, None, [], "m", "no_foot_track")
    ways = []
    still_feet = {side: still for side, still in feet.still.items() if side not in feet.withheld}
    if not still_feet and feet.withheld:
        return summarise_values(name, None, [], "m", next(iter(feet.withheld.values())))
    for side, still in still_feet.items():
        middles = [(start + stop) // 2 for start, stop in find_runs(still & feet.valid[side])]
        lengths = np.linalg.norm(np.diff(feet.p[side][middles, :2], axis=0), axis=1)
        if len(middles):
            ways.append(float(lengths[lengths > STEP_M].sum()))
    if not ways:
        return summarise_values(name, None, [], "m", "no_foot_flat")
    return Parameter(name, None, len(ways), float(np.mean(ways)), None, "m")


def _untold(n: int, reason: str) -> Figure:
    return Figure(np.full(n, np.nan), np.full(n, reason, object))


def _on_belt(strides: Strides, belt_mps: float | None) -> Figures:
    figures = {name: _untold(len(strides.strides), "treadmill") for name in NAMES}
    if belt_mps is not None:
        duration = strides.columns.duration_s
        figures["gait_speed_mps"] = tell_figure(np.full(len(duration), belt_mps), "treadmill")
        figures["stride_length_m"] = tell_figure(belt_mps * duration, "treadmill")
    return figures


@dataclass(frozen=True, eq=False)
class _Foot:
    """Lookup data of a foot for all strides: heights of the sole, and cumulative counts of lost samples
    and of lost packets in swing.
    """

    side: Side
    heights: SoleHeights | None
    lost: NDArray[np.int32]
    patched: NDArray[np.int32]


def _lay_foot(feet: FootTracks, side: Side) -> _Foot:
    patched = feet.patched.get(side, np.zeros(len(feet.t_s), np.bool_))
    foot = _Foot(side, sole_heights(feet, side), _count_before(~feet.valid[side]), _count_before(patched))
    give_pages_back((feet.p[side], feet.q[side]))
    return foot


def _count_before(mask: Bools) -> NDArray[np.int32]:
    """Cumulative count (n + 1,) of true values of a mask (n,) before each sample, and in total."""
    count = np.zeros(len(mask) + 1, np.int32)
    np.cumsum(mask, out=count[1:])
    return count


def _way(p: Floats, first: NDArray[np.intp], last: NDArray[np.intp]) -> tuple[Floats, Floats, Floats]:
    """Horizontal displacement between two samples each of a path (n, 3): x, y and length (m,), m."""
    x, y = (p[last, :2] - p[first, :2]).T
    return x, y, _map(hypot, x, y)


def _map(function: Callable[[float, float], float], x: Floats, y: Floats) -> Floats:
    """Apply a function of two numbers elementwise (m,): numpy's versions are not bit-identical to those of
    the math library.
    """
    return np.array(list(map(function, x.tolist(), y.tolist())), np.float64)


def _explain(flats: Flats, feet: FootTracks, foot: _Foot) -> Codes:
    """Why strides of a foot with these foot-flats have no distance, "" if they have one."""
    has_flats = (flats.first >= 0) & (flats.last >= 0)
    first, last = np.where(has_flats, flats.first, 0), np.where(has_flats, flats.last, 0)
    short = _way(feet.p[foot.side], first, last)[2] < STEP_M
    codes = np.full(len(has_flats), "", object)
    codes[short | (last <= first)] = "no_foot_flat"
    codes[short & (last > first)] = "in_place"
    codes[foot.patched[last + 1] > foot.patched[first]] = "packets_lost"
    codes[foot.lost[last + 1] > foot.lost[first]] = "gap"
    codes[~has_flats] = "no_foot_flat"
    if foot.side in feet.withheld:
        codes[:] = feet.withheld[foot.side]
    return codes


def _measure_side(
    strides: Strides, own: NDArray[np.intp], flats: Flats, feet: FootTracks, foot: _Foot
) -> Figures:
    """Values of some strides of one foot with a known length; `flats` are theirs."""
    stride_columns, side, first, last = strides.columns, foot.side, flats.first, flats.last
    x, y, length = _way(feet.p[side], first, last)
    along = np.stack((x / length, y / length), axis=1)
    mirror = 1.0 if side == "left" else -1.0
    outward = np.stack((-along[:, 1] * mirror, along[:, 0] * mirror), axis=1)
    out = mirror * wrap_angle(yaw(feet.q[side][first]) - _map(atan2, y, x))
    return {
        "gait_speed_mps": tell_figure(length / (feet.t_s[last] - feet.t_s[first]), "gap"),
        "stride_length_m": tell_figure(length, "gap"),
        "circumduction_m": tell_figure(_furthest(feet.p[side], first, last, outward), "gap"),
        "toe_out_deg": tell_figure(np.degrees(out), "gap")
        if feet.posture == "standing"
        else _untold(len(own), "no_standing"),
        **_clearances(stride_columns.tc_s[own], stride_columns.end_s[own], feet, foot.heights, flats),
        **_steps(stride_columns.opposite_ic_s[own], feet, side, flats, along, outward),
    }


def _furthest(p: Floats, first: NDArray[np.intp], last: NDArray[np.intp], outward: Floats) -> Floats:
    """Maximum displacement (m,) of a path in an individual direction (m, 2) from the first of two samples
    each, m.
    """
    far = np.empty(len(first))
    for length in np.unique(last - first).tolist():
        same = np.flatnonzero(last - first == length)
        begins = first[same, None]
        way = p[begins + np.arange(length + 1), :2] - p[begins, :2]
        far[same] = (way @ outward[same, :, None]).max(axis=(1, 2))
    return far


def _clearances(
    tc_s: Floats, end_s: Floats, feet: FootTracks, heights: SoleHeights | None, flats: Flats
) -> Figures:
    """Clearances of the sole between the two foot-flats."""
    n = len(tc_s)
    if heights is None:
        return {name: _untold(n, "no_shoe_geometry") for name in CLEARANCES}
    spans = lay_out(flats.first, flats.last)
    heel, tip = measure_floor_heights(heights, spans, feet.body.ankle_height)
    toe = _untold(n, "no_terminal_contact")
    swings = np.maximum(np.ceil((np.stack((tc_s, end_s)) - feet.t_s[0]) * feet.rate_hz) - spans.first, 0.0)
    stops = np.append(spans.start[1:], len(tip))
    for i in np.flatnonzero(~np.isnan(tc_s)).tolist():
        a, b = (min(spans.start[i] + int(sample), stops[i]) for sample in swings[:, i])
        least = toe_clearance(tip[a:b])
        if isinstance(least, str):
            toe.reasons[i] = least
        else:
            toe.values[i], toe.reasons[i] = least, ""
    return dict(
        zip(CLEARANCES, (tell_figure(np.maximum.reduceat(heel, spans.start), "gap"), toe), strict=True)
    )


def _steps(
    landed_s: Floats, feet: FootTracks, side: Side, flats: Flats, along: Floats, outward: Floats
) -> Figures:
    """Steps at the end of the strides: from the other foot's foot-flat to this one's."""
    other_foot = OTHER[side]
    codes = np.full(len(landed_s), "", object)
    codes[flats.opposite < 0] = "no_foot_flat"
    if other_foot in feet.withheld:
        codes[:] = feet.withheld[other_foot]
    if not feet.linked:
        codes[:] = "feet_not_linked"
    codes[np.isnan(landed_s)] = "opposite_foot_missing"
    if other_foot not in feet.p:
        codes[:] = "opposite_foot_missing"
    length, width = np.full((2, len(codes)), np.nan)
    rows = np.flatnonzero(codes == "")
    if len(rows):
        x, y = (feet.p[side][flats.last[rows], :2] - feet.p[other_foot][flats.opposite[rows], :2]).T
        length[rows] = x * along[rows, 0] + y * along[rows, 1]
        width[rows] = x * outward[rows, 0] + y * outward[rows, 1]
        codes[rows] = "gap"
    figures = {"step_length_m": tell_figure(length, codes), "step_width_m": tell_figure(width, codes)}
    if feet.body.standing_width is None:
        figures["step_width_m"].values[rows], figures["step_width_m"].reasons[rows] = (
            np.nan,
            "standing_width_unknown",
        )
    return figures
