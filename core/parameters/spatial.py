"""Paths of the feet and strides → distances: lengths, width, speed, swing paths.

A foot's place is where its ankle is at its flat (flats.py). Stride length and speed are between the two
flats of one foot, in the same window (docs/science/spatial.md); a step is between the flats of the two feet
and belongs to the foot that lands. The direction of progression of a stride is from its first flat to its
second.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import atan2, ceil, degrees, hypot
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from core.body.feet import FootTracks
from core.events.result import Stride, Strides
from core.frames import SIDES, Bools, Floats, Protocol, Side
from core.held_samples import give_pages_back
from core.parameters.catalogue import list_names
from core.parameters.catalogue.entry import DISTANCES
from core.parameters.clearance import SoleHeights, measure_floor_heights, sole_heights, toe_clearance
from core.parameters.flats import OTHER, Places, find_flats
from core.parameters.result import Parameter
from core.parameters.rows import Column, Row, Value, row_columns, row_parameter
from core.parameters.variability import summarise_values
from core.recording import UniformRecording
from core.rest import find_runs
from core.rotation import wrap_angle, yaw

NAMES: Final[tuple[str, ...]] = (*list_names(DISTANCES, of="stride"), "toe_out_deg")
"""Per-side parameters in the order of the tables."""

STEP_M: Final = 0.05
"""Two rests of a foot closer than this are one place (our choice: below the error of a stride)."""

AT_ONCE: Final = 512
"""Strides after which the paths are let go of."""

Reason = Literal[
    "treadmill", "no_foot_track", "no_foot_flat", "gap", "packets_lost", "feet_not_linked",
    "opposite_foot_missing", "no_shoe_geometry", "no_standing", "no_swing_minimum", "no_terminal_contact",
    "standing_width_unknown", "in_place",
]  # fmt: skip


@dataclass(frozen=True)
class Surface:
    """What was walked on.

    Parameters
    ----------
    belt_speed_mps : of a treadmill, None when nobody entered it or there is none.
    """

    protocol: Protocol = "walk"
    belt_speed_mps: float | None = None


GROUND: Final = Surface()


def surface_of(recording: UniformRecording) -> Surface:
    """What was walked on, as the recording says."""
    return Surface(recording.protocol, recording.belt_speed_mps)


def spatial_rows(strides: Strides, feet: FootTracks | None, surface: Surface = GROUND) -> tuple[Row, ...]:
    """Figures by name of every stride of the list, counted or not, in its order.

    Parameters
    ----------
    feet : None without a foot sensor.

    Returns
    -------
    values in m, m/s and degrees: circumduction outward positive, width positive with the feet on their own
    sides, toe-out external positive at the flat that begins the stride, from its direction while standing for
    calibration. On a treadmill only length and speed, from the belt's speed. Width needs to know how far
    apart the feet stood: without, calibration takes the legs to be vertical, which is wrong by up to a
    decimetre.
    """
    if surface.protocol == "treadmill":
        return tuple(_on_belt(s, surface.belt_speed_mps) for s in strides.strides)
    paths = None if feet is None else _paths(strides, feet)
    rows: list[Row] = []
    for first in range(0, len(strides.strides), AT_ONCE):
        rows += (_row(s, feet, paths) for s in strides.strides[first : first + AT_ONCE])
        _let_go(feet, *(() if feet is None else feet.p))
    return tuple(rows)


def spatial_row(stride: Stride, strides: Strides, feet: FootTracks | None, surface: Surface = GROUND) -> Row:
    """The figures of one stride of a list, as `spatial_rows` gives them."""
    if surface.protocol == "treadmill":
        return _on_belt(stride, surface.belt_speed_mps)
    return _row(stride, feet, None if feet is None else _paths(strides, feet))


def in_place(strides: Strides, feet: FootTracks | None, surface: Surface = GROUND) -> frozenset[int]:
    """Places in the list of strides that end where they began: weight was shifted, nobody walked on.

    Empty on a treadmill, where every stride does.
    """
    if feet is None or surface.protocol == "treadmill":
        return frozenset()
    found = find_flats(strides.strides, feet)
    return frozenset(
        i
        for i, s in enumerate(strides.strides)
        if (at := found.get((s.side, s.start_s))) is not None
        and (then := found.get((s.side, s.end_s))) is not None
        and then > at
        and hypot(*(feet.p[s.side][then, :2] - feet.p[s.side][at, :2]).tolist()) < STEP_M
    )


def per_stride_spatial(rows: Sequence[Row]) -> dict[str, Column]:
    """Columns of the stride table, one entry per stride."""
    return row_columns(rows, NAMES)


def summarise_distances(
    strides: Strides, feet: FootTracks | None, rows: Sequence[Row], surface: Surface = GROUND
) -> tuple[Parameter, ...]:
    """Distances over the counted strides: speed and way of the take, the others by side.

    Returns
    -------
    without a value a reason: "no_strides", "estimator_bad" (the feet are withheld), "path_bad" (this
    foot is) or one of `Reason`, the most frequent of the strides.
    """
    counted = [
        (s.side, row) for s, row in zip(strides.strides, rows, strict=True) if s.excluded_reason is None
    ]
    found = [row_parameter("gait_speed_mps", None, [row for _, row in counted])]
    found.append(_total(feet, surface))
    for side in SIDES:
        own = [row for s, row in counted if s == side]
        found += [row_parameter(name, side, own) for name in NAMES[1:]]
    return tuple(found)


def _total(feet: FootTracks | None, surface: Surface) -> Parameter:
    """Way of the take: from rest to rest of a foot, turns and short steps too; mean of the feet."""
    name = "total_distance_m"
    if surface.protocol == "treadmill":
        return summarise_values(name, None, [], "m", "treadmill")
    if feet is None:
        return summarise_values(name, None, [], "m", "no_foot_track")
    ways = []
    told = {side: still for side, still in feet.still.items() if side not in feet.withheld}
    if not told and feet.withheld:
        return summarise_values(name, None, [], "m", next(iter(feet.withheld.values())))
    for side, still in told.items():
        middles = [(start + stop) // 2 for start, stop in find_runs(still & feet.valid[side])]
        lengths = np.linalg.norm(np.diff(feet.p[side][middles, :2], axis=0), axis=1)
        if len(middles):
            ways.append(float(lengths[lengths > STEP_M].sum()))
    if not ways:
        return summarise_values(name, None, [], "m", "no_foot_flat")
    return Parameter(name, None, len(ways), float(np.mean(ways)), None, "m")


def _on_belt(s: Stride, belt_mps: float | None) -> Row:
    row: dict[str, Value] = dict.fromkeys(NAMES, "treadmill")
    if belt_mps is not None:
        row |= {"gait_speed_mps": belt_mps, "stride_length_m": belt_mps * s.duration_s}
    return row


@dataclass(frozen=True, eq=False)
class _Paths:
    """What is looked up for every stride: flats and the foot's heading there, heights, and how often the
    foot was lost, or packets of its swing, before a sample."""

    places: Places
    heights: Mapping[Side, SoleHeights | None]
    lost: Mapping[Side, NDArray[np.int32]]
    patched: Mapping[Side, NDArray[np.int32]]
    heading: Mapping[tuple[Side, int], float]
    known: bool
    """How far apart the feet stood, without which width is not known."""


def _paths(strides: Strides, feet: FootTracks) -> _Paths:
    found = find_flats(strides.strides, feet)
    heading: dict[tuple[Side, int], float] = {}
    heights: dict[Side, SoleHeights | None] = {}
    for side in feet.p:
        flats = [at for (foot, _), at in found.items() if foot == side and at is not None]
        heading |= {(side, at): v for at, v in zip(flats, yaw(feet.q[side][flats]).tolist(), strict=True)}
        heights[side] = sole_heights(feet, side)
        _let_go(feet, side)
    return _Paths(
        places=found,
        heights=heights,
        lost={side: _count_before(~feet.valid[side]) for side in feet.p},
        patched={
            side: _count_before(feet.patched.get(side, np.zeros(len(feet.t_s), np.bool_))) for side in feet.p
        },
        heading=heading,
        known=feet.body.standing_width is not None,
    )


def _let_go(feet: FootTracks | None, *sides: Side) -> None:
    """Keep none of the paths of a long take in memory, which lie in a file."""
    if feet is not None:
        give_pages_back(path for side in sides for path in (feet.p[side], feet.q[side]))


def _count_before(mask: Bools) -> NDArray[np.int32]:
    """How many (n + 1,) of a mask (n,) are true before each sample, and in all."""
    count = np.zeros(len(mask) + 1, np.int32)
    np.cumsum(mask, out=count[1:])
    return count


def _row(s: Stride, feet: FootTracks | None, paths: _Paths | None) -> Row:
    if feet is None or paths is None or s.side not in feet.p:
        return dict.fromkeys(NAMES, "no_foot_track")
    if s.side in feet.withheld:
        return dict.fromkeys(NAMES, feet.withheld[s.side])
    first, last = paths.places[s.side, s.start_s], paths.places[s.side, s.end_s]
    if first is None or last is None:
        return dict.fromkeys(NAMES, "no_foot_flat")
    if paths.lost[s.side][last + 1] > paths.lost[s.side][first]:
        return dict.fromkeys(NAMES, "gap")
    if paths.patched[s.side][last + 1] > paths.patched[s.side][first]:
        return dict.fromkeys(NAMES, "packets_lost")
    p = feet.p[s.side]
    x, y = (p[last, :2] - p[first, :2]).tolist()
    length = hypot(x, y)
    if length < STEP_M:
        return dict.fromkeys(NAMES, "in_place" if last > first else "no_foot_flat")
    along = np.array([x / length, y / length])
    mirror = 1.0 if s.side == "left" else -1.0
    outward = np.array([-along[1], along[0]]) * mirror
    out = mirror * wrap_angle(paths.heading[s.side, first] - atan2(y, x))
    row: dict[str, Value] = {
        "gait_speed_mps": length / float(feet.t_s[last] - feet.t_s[first]),
        "stride_length_m": length,
        "circumduction_m": float(((p[first : last + 1, :2] - p[first, :2]) @ outward).max()),
        "toe_out_deg": degrees(out) if feet.posture == "standing" else "no_standing",
    }
    row |= _clearance(s, feet, paths.heights[s.side], first, last)
    row |= _step(s, feet, paths, p[last, :2], along, outward)
    return row


def _clearance(
    s: Stride, feet: FootTracks, heights: SoleHeights | None, first: int, last: int
) -> dict[str, Value]:
    """Of the sole between the two flats."""
    if heights is None:
        return {"max_heel_clearance_m": "no_shoe_geometry", "min_toe_clearance_m": "no_shoe_geometry"}
    heel, tip = measure_floor_heights(heights, first, last, feet.body.ankle_height)
    toe: Value = "no_terminal_contact"
    if s.tc_s is not None:
        a, b = (max(ceil((t - feet.t_s[0]) * feet.rate_hz) - first, 0) for t in (s.tc_s, s.end_s))
        toe = toe_clearance(tip[a:b])
    return {"max_heel_clearance_m": float(heel.max()), "min_toe_clearance_m": toe}


def _step(
    s: Stride, feet: FootTracks, paths: _Paths, landed: Floats, along: Floats, outward: Floats
) -> dict[str, Value]:
    """Step that ends the stride: from the other foot's flat to this one's."""
    reason: Reason | None = None
    opposite = None
    if s.opposite_ic_s is None or OTHER[s.side] not in feet.p:
        reason = "opposite_foot_missing"
    elif not feet.linked:
        reason = "feet_not_linked"
    elif OTHER[s.side] in feet.withheld:
        return dict.fromkeys(("step_length_m", "step_width_m"), feet.withheld[OTHER[s.side]])
    else:
        opposite = paths.places[OTHER[s.side], s.opposite_ic_s]
        reason = "no_foot_flat"
    if opposite is None:
        return {"step_length_m": reason or "no_foot_flat", "step_width_m": reason or "no_foot_flat"}
    apart = landed - feet.p[OTHER[s.side]][opposite, :2]
    return {
        "step_length_m": float(apart @ along),
        "step_width_m": float(apart @ outward) if paths.known else "standing_width_unknown",
    }
