"""The phases of Perry between the contacts: mid and terminal stance, initial, mid and terminal swing.

Loading response and pre-swing are the two double supports (temporal.py) and have no second name here. What
divides the others (Perry 1992): the heel rises; the swinging ankle passes the standing one; the tibia of the
swinging leg is vertical. All in % of the stride, so that the seven add up to 100 where all are known.
"""

from __future__ import annotations

from math import isnan
from typing import Final

import numpy as np

from core.angles import JointAngles
from core.body.feet import FootTracks
from core.events.result import Stride, Strides
from core.frames import FOOT, SIDES, SUFFIX, Floats, Segment
from core.parameters.flats import OTHER
from core.parameters.resample import first_crossing, last_crossing, resample
from core.parameters.rows import Row, Value, value_or
from core.parameters.stance import Stances

NAMES: Final = (
    "mid_stance_pct",
    "terminal_stance_pct",
    "initial_swing_pct",
    "mid_swing_pct",
    "terminal_swing_pct",
)
"""In % of the stride, in the order of the tables."""

SWING_POINTS: Final = 51
"""Points of a swing; between two of them a moment is found by interpolation."""


def phase_rows(
    strides: Strides,
    stances: Stances,
    angles: JointAngles | None,
    pitch: dict[Segment, Floats],
    feet: FootTracks | None,
) -> tuple[Row, ...]:
    """Phases of every stride of the list, or why not.

    Parameters
    ----------
    angles, pitch, feet : on one axis. The tibia's lean is the foot's pitch minus dorsiflexion; it is vertical
        as while standing for calibration.

    Returns
    -------
    reasons: "no_standing" (where the tibia is vertical is known from standing), "opposite_foot_missing",
    "no_terminal_contact", "no_foot_flat", "feet_not_linked", "joint_missing", "gap"; "no_mid_stance" and
    "no_terminal_stance" where the heel rises outside single support; "feet_not_adjacent",
    "tibia_not_vertical" where the swing has no such moment, or not in this order.
    """
    adjacent, vertical = _adjacent(strides, feet), _vertical(strides, angles, pitch)
    linked = feet is not None and feet.linked
    # where a foot passes the other is of both paths
    doubt = next(iter(feet.withheld.values()), None) if feet is not None and linked else None
    rows = []
    for i, s in enumerate(strides.strides):
        ankle = f"ankle_dorsiflexion_{SUFFIX[s.side]}"
        upright = "joint_missing"
        if angles is not None and angles.zero == "walking":
            upright = "no_standing"
        elif angles is not None:
            known = ankle in angles.angles
            upright = "tibia_not_vertical" if known else angles.withheld.get(ankle, upright)
        row = _stance(s, float(stances.heel_off_s[i]), stances.rows[i]["push_pct"])
        row |= _swing(s, float(adjacent[i]), float(vertical[i]), linked, upright, doubt)
        rows.append(row)
    return tuple(rows)


def _stance(s: Stride, heel_off_s: float, push: Value) -> dict[str, Value]:
    if s.opposite_tc_s is None or s.opposite_ic_s is None:
        return {"mid_stance_pct": "opposite_foot_missing", "terminal_stance_pct": "opposite_foot_missing"}
    if isnan(heel_off_s):
        return {"mid_stance_pct": str(push), "terminal_stance_pct": str(push)}
    percent = 100.0 / s.duration_s
    single = percent * (s.opposite_ic_s - s.opposite_tc_s)
    if heel_off_s <= s.opposite_tc_s:
        return {"mid_stance_pct": "no_mid_stance", "terminal_stance_pct": single}
    if heel_off_s >= s.opposite_ic_s:
        return {"mid_stance_pct": single, "terminal_stance_pct": "no_terminal_stance"}
    mid = percent * (heel_off_s - s.opposite_tc_s)
    return {"mid_stance_pct": mid, "terminal_stance_pct": single - mid}


def _swing(
    s: Stride, adjacent_s: float, vertical_s: float, linked: bool, upright: str, doubt: str | None
) -> dict[str, Value]:
    names = NAMES[2:]
    if s.tc_s is None:
        return dict.fromkeys(names, "no_terminal_contact")
    passed = doubt or ("feet_not_adjacent" if linked else "feet_not_linked")
    if vertical_s <= adjacent_s:
        vertical_s = float("nan")
    percent = 100.0 / s.duration_s
    mid = percent * (vertical_s - adjacent_s)
    return {
        "initial_swing_pct": value_or(percent * (adjacent_s - s.tc_s), passed),
        "mid_swing_pct": value_or(mid, passed if isnan(adjacent_s) else upright),
        "terminal_swing_pct": value_or(percent * (s.end_s - vertical_s), upright),
    }


def _swings(strides: Strides, own: list[int]) -> Floats:
    """Foot-off to contact of these strides (m, 2) in s, NaN without foot-off."""
    pairs = [(np.nan if (s := strides.strides[i]).tc_s is None else s.tc_s, s.end_s) for i in own]
    return np.array(pairs, np.float64).reshape(-1, 2)


def _adjacent(strides: Strides, feet: FootTracks | None) -> Floats:
    """When (strides,) the swinging ankle passes the other, s; NaN if never or not known."""
    found = np.full(len(strides.strides), np.nan)
    if feet is None or not feet.linked or feet.withheld:
        return found
    for side in SIDES:
        own = [i for i, s in enumerate(strides.strides) if s.side == side]
        if not own or any(x not in feet.p for x in SIDES):
            continue
        ok = feet.valid[side] & feet.valid[OTHER[side]]
        signals = np.concatenate((feet.p[side][:, :2].T, feet.p[OTHER[side]][:, :2].T))
        bounds = _swings(strides, own)
        x, y, other_x, other_y = resample(np.where(ok, signals, np.nan), feet.t_s, bounds, SWING_POINTS)
        along_x, along_y = x[:, -1:] - x[:, :1], y[:, -1:] - y[:, :1]
        ahead = (x - other_x) * along_x + (y - other_y) * along_y
        found[own] = bounds[:, 0] + first_crossing(ahead) * (bounds[:, 1] - bounds[:, 0])
    return found


def _vertical(strides: Strides, angles: JointAngles | None, pitch: dict[Segment, Floats]) -> Floats:
    """When (strides,) the swinging tibia last passes the vertical forwards, s; NaN if never or not known."""
    found = np.full(len(strides.strides), np.nan)
    for side in SIDES:
        ankle = None if angles is None else angles.angles.get(f"ankle_dorsiflexion_{SUFFIX[side]}")
        own = [i for i, s in enumerate(strides.strides) if s.side == side]
        if angles is None or angles.zero == "walking" or ankle is None or FOOT[side] not in pitch or not own:
            continue
        bounds = _swings(strides, own)
        lean = resample((pitch[FOOT[side]] - ankle)[None], angles.t_s, bounds, SWING_POINTS)[0]
        found[own] = bounds[:, 0] + last_crossing(lean) * (bounds[:, 1] - bounds[:, 0])
    return found
