"""Paths of the feet and strides → distances: lengths, width, speed, swing paths.

A foot's place is where its ankle is at its flat: the middle of the longest stillness between its contact and
foot-off. Stride length and speed are between the two flats of one foot, in the same window (spec/field.md
§4b); a step is between the flats of the two feet and belongs to the foot that lands. The direction of
progression of a stride is from its first flat to its second. Heights are above the line between the floor at
both flats, so that drift in height does not count.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from core.body.feet import FootTracks
from core.body.kinematics import sole_points
from core.events.result import Stride, Strides
from core.frames import SIDES, Floats, Protocol, Side
from core.parameters.result import Parameter
from core.parameters.temporal import Column
from core.parameters.variability import summary
from core.recording import UniformRecording
from core.rotation import rotate

NAMES: Final[tuple[str, ...]] = (
    "gait_speed_mps",
    "stride_length_m",
    "step_length_m",
    "step_width_m",
    "circumduction_m",
    "max_heel_clearance_m",
    "min_toe_clearance_m",
)
"""Per-side parameters in the order of the tables."""

BELT: Final = ("gait_speed_mps", "stride_length_m")
"""What the belt's speed gives on a treadmill; everything else needs the room."""

STANCE_SHARE: Final = 0.7
"""Part of the stride in which its flat is looked for when no foot-off was found."""

STEP_M: Final = 0.05
"""Two rests of a foot closer than this are one place (our choice: below the error of a stride)."""

Reason = Literal[
    "treadmill", "no_foot_track", "no_foot_flat", "gap", "feet_not_linked", "opposite_foot_missing",
    "no_shoe_geometry", "standing_width_unknown",
]  # fmt: skip
Value = float | Reason
"""A figure of one stride, or why it has none."""

Row = Mapping[str, Value]


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
    values in m and m/s: circumduction outward positive, width positive with the feet on their own sides. On
    a treadmill only length and speed, from the belt's speed. Width needs to know how far apart the feet
    stood: without, calibration takes the legs to be vertical, which is wrong by up to a decimetre.
    """
    if surface.protocol == "treadmill":
        return tuple(_on_belt(s, surface.belt_speed_mps) for s in strides.strides)
    places = {} if feet is None else _places(strides, feet)
    return tuple(_row(s, feet, places) for s in strides.strides)


def per_stride_spatial(rows: Sequence[Row]) -> dict[str, Column]:
    """Columns of the stride table, one entry per stride."""
    return {n: tuple(v if isinstance(v := row[n], float) else None for row in rows) for n in NAMES}


def spatial(
    strides: Strides, feet: FootTracks | None, rows: Sequence[Row], surface: Surface = GROUND
) -> tuple[Parameter, ...]:
    """Distances over the counted strides: speed and way of the take, the others by side.

    Returns
    -------
    without a value a reason: "no_strides" or one of `Reason`, the most frequent of the strides.
    """
    counted = [
        (s.side, row) for s, row in zip(strides.strides, rows, strict=True) if s.excluded_reason is None
    ]
    found = [_parameter("gait_speed_mps", None, [row for _, row in counted])]
    found.append(_total(feet, surface))
    for side in SIDES:
        own = [row for s, row in counted if s == side]
        found += [_parameter(name, side, own) for name in NAMES[1:]]
    return tuple(found)


def _parameter(name: str, side: Side | None, rows: Sequence[Row]) -> Parameter:
    values = [v for row in rows if isinstance(v := row[name], float)]
    reasons = [v for row in rows if isinstance(v := row[name], str)]
    unit = "m/s" if name.endswith("_mps") else "m"
    why: str | None = None
    if not values:
        why = Counter(reasons).most_common(1)[0][0] if reasons else "no_strides"
    return summary(name, side, values, unit, why)


def _total(feet: FootTracks | None, surface: Surface) -> Parameter:
    """Way of the take: from rest to rest of a foot, turns and short steps too; mean of the feet."""
    name = "total_distance_m"
    if surface.protocol == "treadmill":
        return summary(name, None, [], "m", "treadmill")
    if feet is None:
        return summary(name, None, [], "m", "no_foot_track")
    ways = []
    for side, still in feet.still.items():
        edges = np.flatnonzero(np.diff(np.concatenate(([False], still & feet.valid[side], [False]))))
        middles = (edges[::2] + edges[1::2]) // 2
        lengths = np.linalg.norm(np.diff(feet.p[side][middles, :2], axis=0), axis=1)
        if len(middles):
            ways.append(float(lengths[lengths > STEP_M].sum()))
    if not ways:
        return summary(name, None, [], "m", "no_foot_flat")
    return Parameter(name, None, len(ways), float(np.mean(ways)), None, "m")


def _on_belt(s: Stride, belt_mps: float | None) -> Row:
    row: dict[str, Value] = dict.fromkeys(NAMES, "treadmill")
    if belt_mps is not None:
        row |= {"gait_speed_mps": belt_mps, "stride_length_m": belt_mps * s.duration_s}
    return row


Places = Mapping[tuple[Side, float], int | None]
"""Foot and initial contact → sample of the flat that follows."""


def _places(strides: Strides, feet: FootTracks) -> dict[tuple[Side, float], int | None]:
    """The flat after every initial contact that a stride begins, ends or crosses with."""
    until: dict[tuple[Side, float], float] = {}
    for s in strides.strides:
        stance = STANCE_SHARE * s.duration_s
        until.setdefault((s.side, s.end_s), s.end_s + stance)
        if s.opposite_ic_s is not None:
            until.setdefault((_other(s.side), s.opposite_ic_s), s.opposite_ic_s + stance)
    for s in strides.strides:
        off = s.start_s + STANCE_SHARE * s.duration_s if s.tc_s is None else s.tc_s
        # the stride before tells how long a stance is, where a small step in a turn was not found
        until[s.side, s.start_s] = min(off, until.get((s.side, s.start_s), off))
    return {key: _flat(feet, key[0], key[1], stop) for key, stop in until.items()}


def _flat(feet: FootTracks, side: Side, start_s: float, stop_s: float) -> int | None:
    """Middle sample of the foot's longest rest within a stance, None when it never rests."""
    if side not in feet.p:
        return None
    a, b = np.searchsorted(feet.t_s, (start_s, stop_s))
    still = feet.still[side][a:b] & feet.valid[side][a:b]
    edges = np.flatnonzero(np.diff(np.concatenate(([False], still, [False]))))
    if not len(edges):
        return None
    longest = int(np.argmax(edges[1::2] - edges[::2]))
    return int(a + (edges[2 * longest] + edges[2 * longest + 1]) // 2)


def _row(s: Stride, feet: FootTracks | None, places: Places) -> Row:
    if feet is None or s.side not in feet.p:
        return dict.fromkeys(NAMES, "no_foot_track")
    first, last = places[s.side, s.start_s], places[s.side, s.end_s]
    if first is None or last is None:
        return dict.fromkeys(NAMES, "no_foot_flat")
    if not feet.valid[s.side][first : last + 1].all():
        return dict.fromkeys(NAMES, "gap")
    p = feet.p[s.side]
    along = p[last, :2] - p[first, :2]
    length = float(np.linalg.norm(along))
    if length < STEP_M:
        return dict.fromkeys(NAMES, "no_foot_flat")
    along /= length
    outward = np.array([-along[1], along[0]]) * (1.0 if s.side == "left" else -1.0)
    row: dict[str, Value] = {
        "gait_speed_mps": length / float(feet.t_s[last] - feet.t_s[first]),
        "stride_length_m": length,
        "circumduction_m": float(((p[first : last + 1, :2] - p[first, :2]) @ outward).max()),
        "max_heel_clearance_m": _heel_clearance(s, feet, first, last),
        # the toe passes the floor by one or two centimetres, less than shoes differ
        "min_toe_clearance_m": "no_shoe_geometry",
    }
    row |= _step(s, feet, places, p[last, :2], along, outward)
    return row


def _step(
    s: Stride, feet: FootTracks, places: Places, landed: Floats, along: Floats, outward: Floats
) -> dict[str, Value]:
    """Step that ends the stride: from the other foot's flat to this one's."""
    reason: Reason | None = None
    opposite = None
    if s.opposite_ic_s is None or _other(s.side) not in feet.p:
        reason = "opposite_foot_missing"
    elif not feet.linked:
        reason = "feet_not_linked"
    else:
        opposite = places[_other(s.side), s.opposite_ic_s]
        reason = "no_foot_flat"
    if opposite is None:
        return {"step_length_m": reason or "no_foot_flat", "step_width_m": reason or "no_foot_flat"}
    apart = landed - feet.p[_other(s.side)][opposite, :2]
    known = feet.body.standing_width is not None
    return {
        "step_length_m": float(apart @ along),
        "step_width_m": float(apart @ outward) if known else "standing_width_unknown",
    }


def _heel_clearance(s: Stride, feet: FootTracks, first: int, last: int) -> float:
    part = slice(first, last + 1)
    p = feet.p[s.side][part]
    heel = np.array(sole_points(feet.body)[0])
    share = np.linspace(0.0, 1.0, len(p))
    floor = p[0, 2] * (1.0 - share) + p[-1, 2] * share - feet.body.ankle_height
    return float(((p + rotate(feet.q[s.side][part], heel))[:, 2] - floor).max())


def _other(side: Side) -> Side:
    return "right" if side == "left" else "left"
