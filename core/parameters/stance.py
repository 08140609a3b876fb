"""Parts of the stance: loading, foot flat, push-off, from the pitch of the foot.

The foot is flat around its quietest moment for as long as its pitch stays within `FLAT_RAD` of that moment's
(IC to foot flat, flat, heel-off to TC, in % of stance). Not fitted to data: the limit corresponds to the
geometry of a centimetre.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Final

import numpy as np

from sagittal.core.events.result import Strides
from sagittal.core.frames import FOOT, Floats, Oriented, Segment
from sagittal.core.parameters.resample import resample
from sagittal.core.parameters.rows import Figures, tell_figure

NAMES: Final = ("loading_pct", "foot_flat_pct", "push_pct")
"""In % of stance, in the order of the tables."""

FLAT_RAD: Final = radians(3.0)
"""Pitch at which heel or toe of a foot of 20 cm between them is 1 cm off the floor."""

LEVEL_RAD: Final = radians(10.0)
"""A foot whose quiet pitch lies further from that of standing is not flat on the floor, as in walking on the
toes. Our choice: the quiet pitch of every stance of gaitmap_foot is within 2° of standing."""

QUIET: Final = 10
"""Points, in % of stance, over which the quietest moment is looked for."""


@dataclass(frozen=True, eq=False)
class Stances:
    """Foot-flat phases, one entry per stride of the list.

    Parameters
    ----------
    flat_s, heel_off_s : (strides,) s, NaN if missing. parts : of the stance in %, or the reason:
        "no_foot_sensor", "no_terminal_contact", "gap", "no_foot_flat".
    """

    flat_s: Floats
    heel_off_s: Floats
    parts: Figures


def foot_pitches(orientations: Oriented) -> dict[Segment, Floats]:
    """Foot → pitch (n,) in rad, toes up positive, 0 in standing; NaN where its sensor was lost."""
    pitches: dict[Segment, Floats] = {}
    for foot in FOOT.values():
        if foot in orientations.q:
            w, x, y, z = orientations.q[foot].T
            # how far the forward axis rises: the sine that events are found in (core/events/foot_pitch.py)
            angle = np.arcsin(np.clip(2.0 * (x * z - w * y), -1.0, 1.0))
            pitches[foot] = np.where(orientations.valid[foot], angle, np.nan)
    return pitches


def find_stances(strides: Strides, t_s: Floats, pitch: dict[Segment, Floats]) -> Stances:
    """Determine the foot-flat phase of every stride.

    Parameters
    ----------
    pitch : from `foot_pitches`, on `t_s` (n,).
    """
    start, off = strides.columns.start_s, strides.columns.tc_s
    part = np.full((len(start), 2), np.nan)
    reason = np.full(len(start), "no_foot_sensor", object)
    for side, own in strides.columns.of.items():
        if FOOT[side] not in pitch or not len(own):
            continue
        pieces = resample(pitch[FOOT[side]][None], t_s, np.stack((start[own], off[own]), axis=1))[0]
        part[own] = _flat_part(pieces)
        reason[own] = np.where(np.isnan(off[own]), "no_terminal_contact",
                               np.where(np.isnan(pieces[:, 0]), "gap", "no_foot_flat"))  # fmt: skip
    whole = off - start
    shares = (part[:, 0], part[:, 1] - part[:, 0], 1.0 - part[:, 1])
    parts = {name: tell_figure(100.0 * x, reason) for name, x in zip(NAMES, shares, strict=True)}
    return Stances(start + part[:, 0] * whole, start + part[:, 1] * whole, parts)


def _flat_part(pitch: Floats) -> Floats:
    """Start and end (m, 2) of the flat phase in pieces (m, 101), as fractions of the stance; NaN without
    one.
    """
    m, points = pitch.shape
    finite = np.asarray(np.isfinite(pitch).all(axis=1), np.bool_)
    pitch = np.where(finite[:, None], pitch, 0.0)
    way = np.concatenate((np.zeros((m, 1)), np.cumsum(np.abs(np.diff(pitch, axis=1)), axis=1)), axis=1)
    moved = way[:, QUIET:] - way[:, :-QUIET]
    quiet = np.argmin(moved, axis=1)
    each = np.arange(m)
    windows = quiet[:, None] + np.arange(QUIET + 1)
    level = np.mean(pitch[each[:, None], windows], axis=1)
    off = np.abs(pitch - level[:, None]) - FLAT_RAD
    index, middle = np.arange(points), quiet + QUIET // 2
    # the last point off the floor before the quiet middle, the first one after it
    previous_off = np.where((off >= 0.0) & (index < middle[:, None]), index, -1).max(axis=1)
    next_off = np.where((off >= 0.0) & (index > middle[:, None]), index, points).min(axis=1)
    first, last = np.maximum(previous_off, 0), np.minimum(next_off, points - 1)
    # where between two points the limit is passed
    enter = np.where(previous_off < 0, 0.0, first + _share(off[each, first], off[each, first + 1]))
    leave = np.where(next_off == points, points - 1.0, last - _share(off[each, last], off[each, last - 1]))
    flat = finite & (moved[each, quiet] < FLAT_RAD) & (np.abs(level) < LEVEL_RAD) & (off[each, middle] < 0.0)
    return np.where(flat[:, None], np.stack((enter, leave), axis=1) / (points - 1), np.nan)


def _share(outside: Floats, inside: Floats) -> Floats:
    """Fraction of the way from a value ≥ 0 to one < 0 at which zero is crossed."""
    way = outside - inside
    return np.asarray(np.clip(outside / np.where(way > 0.0, way, 1.0), 0.0, 1.0))
