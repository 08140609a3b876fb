"""DeviceMotion events of a phone as JSON (docs/reference/formats.md, "Phone").

Acceleration with gravity in m/s², rotation rate in deg/s. Browsers disagree on the axes of alpha, beta and
gamma; the correct assignment is found from gravity, which must rotate with the rates, ġ = −ω × g. That holds
for either sign of gravity, on which browsers disagree too, so the assumption is reported.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from sagittal.core import rotation
from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats import text
from sagittal.core.formats.aliases import segment_in
from sagittal.core.formats.draft import Draft, make_draft
from sagittal.core.formats.json_tree import read_json
from sagittal.core.formats.source import stem_of
from sagittal.core.formats.source_spec import GYR_UNITS, SourceSpec
from sagittal.core.frames import GRAVITY, Floats
from sagittal.core.signals.correction import AGAINST

LABEL: Final = "DeviceMotion JSON"
SIGN_ASSUMED: Final = "sign_assumed"
"""Code of the notice that the sign of acceleration was taken, not known."""
_MARK: Final = b'"accelerationIncludingGravity"'
_ORDERS: Final = {
    "alpha, beta, gamma about x, y, z": (0, 1, 2),
    "alpha, beta, gamma about z, x, y": (1, 2, 0),
}
"""How the rates are read as x, y, z: as the W3C says now, and as it said before."""
_WINDOW_S: Final = 0.5
"""Over so long gravity is followed by the rates [our choice]."""
_STILL: Final = 0.8
"""m/s² that the acceleration may be off gravity where it is taken for gravity [our choice]."""
_FITS: Final = np.radians(10.0)
_OTHERS: Final = np.radians(20.0)
"""The right reading is closer than the first, every other one farther off than the second [our choice]."""
_MILLI: Final = 1e-3


_FELT: Final = "accelerationIncludingGravity"
_TURNED: Final = "rotationRate"
_CLOCKS: Final = ("t_ms", "timeStamp", "timestamp")


def looks_like(data: bytes) -> bool:
    """Whether the data contain the DeviceMotion name of acceleration."""
    return data.lstrip()[:1] in (b"{", b"[") and _MARK in data[:65536]


def read(data: bytes, source: str, spec: SourceSpec | None = None) -> tuple[Draft, ...]:
    """Read the events of the phone.

    Raises
    ------
    FormatError `bad_json`, `empty`, `no_time`, `missing_acc`.
    """
    try:
        root: Any = read_json(data)
        events: list[dict[str, Any]] = root["events"] if isinstance(root, dict) else root
        t_s = _times(events)
        acc = _vectors(events, _FELT, ("x", "y", "z"))
        rates = _vectors(events, _TURNED, ("alpha", "beta", "gamma"))
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as e:
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
    device = stem_of(source)
    notices = [_signs(device, source)]
    if not sure:
        notices.append(
            Notice(
                "axes_assumed",
                f"{source} turns too little to tell which axis is which; {order} was taken. "
                "Turn the phone about every axis at the start.",
            )
        )
    return (
        make_draft(
            device,
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


def _signs(device: str, source: str) -> Notice:
    """Notice on the assumed sign of acceleration; the wrong one swaps left and right of a single phone."""
    turned = json.dumps({"corrections": {device: {"acc_axes": AGAINST}}}, ensure_ascii=False)
    return Notice(
        SIGN_ASSUMED,
        f"{source} does not say the sign of its acceleration; +9.8 along the axis that points up was taken. "
        "An iPhone or iPad gives the opposite, and left and right would be exchanged. "
        f"If it is from one, declare {turned}.",
    )


def _times(events: Sequence[dict[str, Any]]) -> Floats:
    """Time of every event, s by the first available clock."""
    clocks = (_numbers([e.get(name) for e in events]) * _MILLI for name in _CLOCKS)
    return next((t for t in clocks if np.isfinite(t).any()), np.full(len(events), np.nan))


def _vectors(events: Sequence[dict[str, Any]], name: str, parts: tuple[str, str, str]) -> Floats:
    """Three numbers (n, 3) of every event; NaN if missing."""
    x, y, z = parts
    vectors = [e.get(name) or {} for e in events]
    return _numbers([v for f in vectors for v in (f.get(x), f.get(y), f.get(z))]).reshape(-1, 3)


def _numbers(values: Sequence[float | None]) -> Floats:
    """Numbers with NaN for missing ones and values impossible for sensors and clocks."""
    out = np.array(values, np.float64)
    out[~(np.abs(out) < text.LARGEST)] = np.nan
    return out


def _find_order(t_s: Floats, acc: Floats, rates: Floats) -> tuple[str, bool]:
    """The axis order of the rates that is consistent with gravity, and whether all others are clearly
    inconsistent.
    """
    first = next(iter(_ORDERS))
    good = np.isfinite(t_s) & np.isfinite(acc).all(axis=1) & np.isfinite(rates).all(axis=1)
    t, g, w = t_s[good], acc[good], rates[good]
    if len(t) < 4 or (np.diff(t) <= 0).any():
        return first, False
    step_s = float(np.median(np.diff(t)))
    steps = max(2, round(_WINDOW_S / step_s))
    starts = np.arange(0, len(t) - steps, max(1, steps // 4))
    off = np.abs(np.linalg.norm(g, axis=1) - GRAVITY)
    whole = np.abs(t[starts + steps] - t[starts] - steps * step_s) < step_s
    starts = starts[(off[starts] < _STILL) & (off[starts + steps] < _STILL) & whole]
    if not len(starts):
        return first, False
    errors = {}
    for name, order in _ORDERS.items():
        turned = rotation.exp(np.zeros((len(starts), 3)))
        for k in range(steps):
            rate = (w[starts + k] + w[starts + k + 1])[:, order] / 2
            turned = rotation.multiply(turned, rotation.exp(rate * step_s))
        expected = rotation.rotate(rotation.conjugate(turned), g[starts])
        crossed = np.linalg.norm(np.cross(expected, g[starts + steps]), axis=1)
        angle = np.arctan2(crossed, np.sum(expected * g[starts + steps], axis=1))
        # the windows that turn most tell the readings apart
        errors[name] = float(np.quantile(angle, 0.9))
    best, runner_up = sorted(errors, key=lambda name: errors[name])
    sure = errors[best] < _FITS and errors[runner_up] > _OTHERS
    return (best if sure else first), sure
