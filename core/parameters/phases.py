"""The phases of Perry between the contacts: mid and terminal stance, initial, mid and terminal swing.

Loading response and pre-swing are the two double supports (temporal.py) and have no second name here. The
others are delimited (Perry 1992) by heel rise, by the swinging ankle passing the supporting one, and by the
tibia of the swinging leg being vertical. All in % of the stride; the seven add up to 100 if all are known.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.angles import JointAngles
from sagittal.core.body.feet import FootTracks
from sagittal.core.events.result import Strides
from sagittal.core.frames import FOOT, SIDES, SUFFIX, Floats, Segment, Side
from sagittal.core.parameters.flats import OTHER
from sagittal.core.parameters.resample import first_crossing, last_crossing, resample
from sagittal.core.parameters.rows import Figure, Figures, tell_figure
from sagittal.core.parameters.stance import Stances

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


def measure_phases(
    strides: Strides,
    stances: Stances,
    angles: JointAngles | None,
    pitch: dict[Segment, Floats],
    feet: FootTracks | None,
) -> Figures:
    """Phases of every stride of the list, or the reasons for missing ones.

    Parameters
    ----------
    angles, pitch, feet : on one axis. The inclination of the tibia is the foot pitch minus dorsiflexion;
        vertical is its orientation in standing for calibration.

    Returns
    -------
    Phases with reasons: "no_standing" (the vertical tibia is defined by standing), "opposite_foot_missing",
    "no_terminal_contact", "no_foot_flat", "feet_not_linked", "joint_missing", "gap"; "no_mid_stance" and
    "no_terminal_stance" if the heel rises outside single support; "feet_not_adjacent", "tibia_not_vertical"
    if the swing has no such moment, or not in this order.
    """
    figures = (*_stance(strides, stances), *_swing(strides, angles, pitch, feet))
    return dict(zip(NAMES, figures, strict=True))


def _stance(strides: Strides, stances: Stances) -> tuple[Figure, Figure]:
    """Mid and terminal stance: single support before and after heel rise."""
    stride_columns = strides.columns
    heel_off, begins, ends = stances.heel_off_s, stride_columns.opposite_tc_s, stride_columns.opposite_ic_s
    percent = 100.0 / stride_columns.duration_s
    single = percent * (ends - begins)
    mid = percent * (heel_off - begins)
    early, late = heel_off <= begins, heel_off >= ends
    no_opposite = np.isnan(begins) | np.isnan(ends)
    push_reasons = np.where(
        no_opposite, np.array("opposite_foot_missing", object), stances.parts["push_pct"].reasons
    )
    no_mid, no_end = push_reasons.copy(), push_reasons.copy()
    no_mid[early & ~no_opposite], no_end[late & ~early & ~no_opposite] = "no_mid_stance", "no_terminal_stance"
    return (
        tell_figure(np.where(no_opposite | early, np.nan, np.where(late, single, mid)), no_mid),
        tell_figure(np.where(early, single, np.where(late, np.nan, single - mid)), no_end),
    )


def _swing(
    strides: Strides, angles: JointAngles | None, pitch: dict[Segment, Floats], feet: FootTracks | None
) -> tuple[Figure, Figure, Figure]:
    """Initial, mid and terminal swing, between foot-off, passing ankle, vertical tibia and contact."""
    stride_columns = strides.columns
    adjacent, vertical = _adjacent(strides, feet), _vertical(strides, angles, pitch)
    vertical = np.where(vertical <= adjacent, np.nan, vertical)
    linked = feet is not None and feet.linked
    # where a foot passes the other is of both paths
    doubt = next(iter(feet.withheld.values()), None) if feet is not None and linked else None
    passed = np.full(len(vertical), doubt or ("feet_not_adjacent" if linked else "feet_not_linked"), object)
    upright = np.empty(len(vertical), object)
    for side, own in stride_columns.of.items():
        upright[own] = _why_not_upright(side, angles)
    no_off = np.isnan(stride_columns.tc_s)
    passed[no_off] = upright[no_off] = "no_terminal_contact"
    percent = np.where(no_off, np.nan, 100.0 / stride_columns.duration_s)
    return (
        tell_figure(percent * (adjacent - stride_columns.tc_s), passed),
        tell_figure(percent * (vertical - adjacent), np.where(np.isnan(adjacent), passed, upright)),
        tell_figure(percent * (stride_columns.end_s - vertical), upright),
    )


def _why_not_upright(side: Side, angles: JointAngles | None) -> str:
    """Why the tibia of a side is never vertical."""
    if angles is None:
        return "joint_missing"
    if angles.zero == "walking":
        return "no_standing"
    ankle = f"ankle_dorsiflexion_{SUFFIX[side]}"
    return "tibia_not_vertical" if ankle in angles.angles else angles.withheld.get(ankle, "joint_missing")


def _swings(strides: Strides, own: NDArray[np.intp]) -> Floats:
    """Foot-off to contact of these strides (m, 2) in s, NaN without foot-off."""
    return np.stack((strides.columns.tc_s[own], strides.columns.end_s[own]), axis=1)


def _adjacent(strides: Strides, feet: FootTracks | None) -> Floats:
    """Time (strides,) at which the swinging ankle passes the other, s; NaN if never or unknown."""
    times = np.full(len(strides.strides), np.nan)
    if feet is None or not feet.linked or feet.withheld:
        return times
    for side in SIDES:
        own = strides.columns.of[side]
        if not len(own) or any(x not in feet.p for x in SIDES):
            continue
        ok = feet.valid[side] & feet.valid[OTHER[side]]
        signals = (np.where(ok, feet.p[foot][:, k], np.nan) for foot in (side, OTHER[side]) for k in (0, 1))
        bounds = _swings(strides, own)
        x, y, other_x, other_y = resample(signals, feet.t_s, bounds, SWING_POINTS)
        along_x, along_y = x[:, -1:] - x[:, :1], y[:, -1:] - y[:, :1]
        ahead = (x - other_x) * along_x + (y - other_y) * along_y
        times[own] = bounds[:, 0] + first_crossing(ahead) * (bounds[:, 1] - bounds[:, 0])
    return times


def _vertical(strides: Strides, angles: JointAngles | None, pitch: dict[Segment, Floats]) -> Floats:
    """Last time (strides,) at which the swinging tibia passes the vertical forwards, s; NaN if never or
    unknown.
    """
    times = np.full(len(strides.strides), np.nan)
    for side in SIDES:
        ankle = None if angles is None else angles.angles.get(f"ankle_dorsiflexion_{SUFFIX[side]}")
        own = strides.columns.of[side]
        if angles is None or angles.zero == "walking" or ankle is None or FOOT[side] not in pitch:
            continue
        bounds = _swings(strides, own)
        lean = resample((pitch[FOOT[side]] - ankle)[None], angles.t_s, bounds, SWING_POINTS)[0]
        times[own] = bounds[:, 0] + last_crossing(lean) * (bounds[:, 1] - bounds[:, 0])
    return times
