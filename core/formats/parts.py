"""One sensor from several files: acceleration, angular rate and magnetic field, each with its own clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats.draft import Draft
from sagittal.core.frames import Floats

_HOLE: Final = 2.5
"""Samples of a part that may be apart and are still interpolated between."""
_FASTER: Final = 1.2
"""So much faster than the acceleration a rate of turn gives the times of its sensor."""


def join_parts(drafts: Sequence[Draft]) -> list[Draft]:
    """Join the parts of every sensor; complete sensors are returned unchanged.

    Parameters
    ----------
    drafts : with increasing times.

    Raises
    ------
    FormatError
        missing_acc where a sensor has no file of acceleration, gravity_removed where that is without gravity.
    """
    devices = dict.fromkeys(d.device_id for d in drafts)
    return [_join([d for d in drafts if d.device_id == device]) for device in devices]


def _join(own: Sequence[Draft]) -> Draft:
    """One sensor of all its parts."""
    parts = {d.part: d for d in own if d.part is not None}
    base = next((d for d in own if d.part is None), None)
    if not parts and base is not None:
        return base
    if base is None:
        base = _with_gravity(parts)
    gyr = parts.get("gyr")
    notices = [n for d in own for n in d.notices if not (n.code == "missing_gyro" and gyr is not None)]
    ticks = base.ticks
    if gyr is not None and _spacing(gyr.ticks) * _FASTER < _spacing(base.ticks):
        ticks = gyr.ticks
    step = _spacing(ticks)
    rate = 1.0 / step if base.clock == "device" else base.rate_hz
    sources = ", ".join(dict.fromkeys(d.source for d in own))
    notices.append(
        Notice(
            "files_joined",
            f"{base.device_id} was put together from {sources}.",
            base.device_id,
            severity="info",
        )
    )
    return replace(
        base,
        source=sources,
        ticks=ticks,
        acc=_lay(base, ticks),
        gyr=base.gyr if gyr is None else _lay(gyr, ticks),
        mag=base.mag if "mag" not in parts else _lay(parts["mag"], ticks),
        quat=base.quat if ticks is base.ticks else None,
        rate_hz=rate,
        notices=tuple(dict.fromkeys(notices)),
        part=None,
    )


def _with_gravity(parts: dict[str, Draft]) -> Draft:
    """Acceleration of a sensor from the parts that make it."""
    linear, gravity = parts.get("linear"), parts.get("gravity")
    if linear is not None and gravity is not None:
        return replace(linear, acc=linear.acc + _lay(gravity, linear.ticks), part=None)
    if linear is not None:
        raise FormatError(
            "gravity_removed",
            f"{linear.source} holds acceleration without gravity, which is needed for orientation. Export "
            "the total acceleration (TotalAcceleration), or add the file of gravity (Gravity.csv).",
            sensor=linear.device_id,
        )
    one = next(iter(parts.values()))
    raise FormatError(
        "missing_acc",
        f"{one.source} has no file of acceleration of {one.device_id} beside it; add it.",
        sensor=one.device_id,
    )


def _lay(part: Draft, ticks: Floats) -> Floats:
    """A signal (n, 3) at other times, NaN where it has a hole or has not begun."""
    values, own = part.acc, part.ticks
    if len(own) == len(ticks) and np.array_equal(own, ticks):
        return values
    good = np.isfinite(values).all(axis=1)
    own, values = own[good], values[good]
    if len(own) < 2:
        return np.full((len(ticks), 3), np.nan)
    out = np.stack([np.interp(ticks, own, values[:, k]) for k in range(3)], axis=1)
    upper = np.clip(np.searchsorted(own, ticks), 1, len(own) - 1)
    step = _spacing(own)
    outside = (ticks < own[0] - 0.5 * step) | (ticks > own[-1] + 0.5 * step)
    inside = (ticks > own[upper - 1]) & (ticks < own[upper])
    out[outside | (inside & (own[upper] - own[upper - 1] > _HOLE * step))] = np.nan
    return out


def _spacing(ticks: Floats) -> float:
    return float(np.median(np.diff(ticks))) if len(ticks) > 1 else np.inf
