"""A phone's DeviceMotion events as JSON (docs/formats.md, "Phone").

Acceleration with gravity in m/s², rotation rate in deg/s. Browsers disagree on which axis alpha, beta and
gamma turn about; gravity decides: it must turn as the rates say, ġ = −ω × g. Its sign, on which they disagree
too, is not told here.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from core.errors import FormatError, Notice
from core.formats import text
from core.formats.aliases import segment_in
from core.formats.draft import Draft, make_draft
from core.formats.source import stem_of
from core.formats.source_spec import GYR_UNITS, SourceSpec
from core.frames import Floats

LABEL: Final = "DeviceMotion JSON"
_MARK: Final = b'"accelerationIncludingGravity"'
_ORDERS: Final = {
    "alpha, beta, gamma about x, y, z": (0, 1, 2),
    "alpha, beta, gamma about z, x, y": (1, 2, 0),
}
"""How the rates are read as x, y, z: as the W3C says now, and as it said before."""
_CLEARLY: Final = 0.8
"""A reading whose error is below so much of the other's is the right one [our choice]."""
_SMOOTHED_S: Final = 0.25
"""Over so long steps and shocks average out and gravity stays [our choice]."""
_MILLI: Final = 1e-3


_FELT: Final = "accelerationIncludingGravity"
_TURNED: Final = "rotationRate"
_CLOCKS: Final = ("t_ms", "timeStamp", "timestamp")


def looks_like(data: bytes) -> bool:
    """Tell DeviceMotion events by the browser's name for acceleration."""
    return data.lstrip()[:1] in (b"{", b"[") and _MARK in data[:65536]


def read(data: bytes, source: str, spec: SourceSpec | None = None) -> tuple[Draft, ...]:
    """Read the phone.

    Raises
    ------
    FormatError `bad_json`, `empty`, `no_time`, `missing_acc`.
    """
    try:
        root = json.loads(data)
        events: list[dict[str, Any]] = root["events"] if isinstance(root, dict) else root
        t_s = _times(events)
        acc = _vectors(events, _FELT, ("x", "y", "z"))
        rates = _vectors(events, _TURNED, ("alpha", "beta", "gamma"))
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError) as e:
        raise FormatError(
            "bad_json",
            f"{source} is not a list of DeviceMotion events ({type(e).__name__}); export it again.",
        ) from e
    if not len(t_s):
        raise FormatError("empty", f"{source} holds no events; record again.")
    if not np.isfinite(t_s).any():
        raise FormatError("no_time", f"{source}: its events have no time (t_ms or timeStamp); record again.")
    rates = rates * GYR_UNITS[(spec and spec.gyr_unit) or "deg/s"]
    order, sure = _find_order(t_s, acc, rates)
    notices = (
        []
        if sure
        else [
            Notice(
                "axes_assumed",
                f"{source} turns too little to tell which axis is which; {order} was taken. "
                "Turn the phone about every axis at the start.",
            )
        ]
    )
    return (
        make_draft(
            stem_of(source),
            source,
            "device",
            t_s,
            acc=acc,
            gyr=rates[:, _ORDERS[order]],
            rate_hz=spec.rate_hz if spec else None,
            notices=notices,
            segment=segment_in(source),
        ),
    )


def _times(events: Sequence[dict[str, Any]]) -> Floats:
    """When every event was, s by the first clock that any event has."""
    clocks = (_numbers([e.get(name) for e in events]) * _MILLI for name in _CLOCKS)
    return next((t for t in clocks if np.isfinite(t).any()), np.full(len(events), np.nan))


def _vectors(events: Sequence[dict[str, Any]], name: str, parts: tuple[str, str, str]) -> Floats:
    """Three numbers (n, 3) of every event; NaN where it has none."""
    x, y, z = parts
    found = [e.get(name) or {} for e in events]
    return _numbers([v for f in found for v in (f.get(x), f.get(y), f.get(z))]).reshape(-1, 3)


def _numbers(values: Sequence[float | None]) -> Floats:
    """Numbers with NaN for what is missing, or what no sensor and no clock gives."""
    out = np.array(values, np.float64)
    out[~(np.abs(out) < text.LARGEST)] = np.nan
    return out


def _find_order(t_s: Floats, acc: Floats, rates: Floats) -> tuple[str, bool]:
    """The reading of the rates that turns gravity as measured, and whether it is clearly the better one."""
    good = np.isfinite(t_s) & np.isfinite(acc).all(axis=1) & np.isfinite(rates).all(axis=1)
    t, g, w = t_s[good], acc[good], rates[good]
    first = next(iter(_ORDERS))
    span = float(t[-1] - t[0]) if len(t) > 1 else 0.0
    if len(t) < 20 or span < 4 * _SMOOTHED_S or (np.diff(t) <= 0).any():
        return first, False
    width = min(len(t) // 4, max(1, round(_SMOOTHED_S * len(t) / span)))
    kernel = np.ones(width) / width

    def smooth(x: Floats) -> Floats:
        return np.stack([np.convolve(x[:, i], kernel, "valid") for i in range(3)], axis=1)

    dt = np.gradient(t)[:, None]
    change = smooth(np.gradient(g, axis=0) / dt)
    errors = {
        name: float(np.sum((change + smooth(np.cross(w[:, order], g))) ** 2))
        for name, order in _ORDERS.items()
    }
    best = min(errors, key=lambda name: errors[name])
    other = max(errors.values())
    sure = errors[best] < _CLEARLY * other
    return (best if sure else first), sure
