"""Between a file and a stream: signals in SI units whose common time origin is not known yet."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.errors import FormatError, Notice, Severity
from sagittal.core.frames import Floats, Segment
from sagittal.core.signals.held_samples import cut_blocks, is_complete

WRAP_32: Final = 1 << 32
FEW_ROWS: Final = 0.01
"""Share of rows that a file may lose for information only: whether what is missing changes a number is judged
on the time axis, which reports gaps and filled samples (core/quality/assessment.py) [our choice]."""


_SUMMED: Final = 16
_WEIGHTS: Final = np.array([pow(0x9E3779B97F4A7C15, i, 1 << 64) for i in range(_SUMMED)], np.uint64)
"""Odd, so that no bit of a word is lost; without them words in another order have the same sum."""


@dataclass(frozen=True, eq=False)
class Draft:
    """One sensor of one file.

    Parameters
    ----------
    clock : kind of `ticks` (n,): "counter" packet counter as written, "device" seconds, "index" row number.
    acc, gyr, mag : (n, 3), quat : (n, 4); SI units, NaN where missing; None without such columns.
    rate_hz : None = not given in the file. wrap : tick at which the clock starts again; None = never for a
        device clock, at 16 bit for a counter, or at 32 bit if its values exceed 16.
    segment : sensor placement given in the file, None without one. tick : s of the smallest unit in
        which a device clock is written, 0 = unknown. part : "gyr", "mag", "linear" (acceleration without
        gravity) or "gravity" where `acc` holds that signal of a sensor whose others are in other files.
    """

    device_id: str
    source: str
    clock: str
    ticks: Floats
    acc: Floats
    gyr: Floats | None
    mag: Floats | None
    quat: Floats | None
    rate_hz: float | None
    notices: tuple[Notice, ...] = ()
    wrap: float | None = None
    segment: Segment | None = None
    tick: float = 0.0
    part: str | None = None


def make_draft(
    device: str,
    source: str,
    clock: str,
    ticks: Floats,
    *,
    acc: Floats,
    gyr: Floats | None = None,
    mag: Floats | None = None,
    quat: Floats | None = None,
    rate_hz: float | None = None,
    notices: Sequence[Notice] = (),
    wrap: float | None = None,
    segment: Segment | None = None,
    tick: float = 0.0,
) -> Draft:
    """Draft of one sensor; a signal without any number is absent, and a missing gyroscope gives a notice.

    Raises
    ------
    FormatError `missing_acc`.
    """
    if not has_whole_row(acc):
        raise FormatError(
            "missing_acc",
            f"{source}: the acceleration of {device} holds no numbers; export it again with acceleration.",
            sensor=device,
        )
    draft_notices = [replace(n, sensor=device) for n in notices]
    gyr, mag, quat = (x if x is not None and np.isfinite(x).any() else None for x in (gyr, mag, quat))
    if gyr is None:
        draft_notices.append(
            Notice(
                "missing_gyro",
                f"{source}: sensor {device} has no gyroscope signal, so no walk can be computed from it. "
                "Record or export it with the gyroscope on.",
                device,
            )
        )
    return Draft(
        device, source, clock, ticks, acc, gyr, mag, quat, rate_hz, tuple(draft_notices), wrap, segment, tick
    )


def grade_loss(lost: int, rows: int) -> Severity:
    """Severity of lost rows in a file: information up to `FEW_ROWS`, a warning above."""
    return "info" if lost <= FEW_ROWS * rows else "warning"


def digest(d: Draft) -> str:
    """Digest of the signals in single precision, so that a stored and reread stream has the same digest."""
    return signal_digest(d.acc, d.gyr, d.mag)


def signal_digest(acc: Floats, gyr: Floats | None, mag: Floats | None) -> str:
    """Fingerprint of the samples of one sensor, (n, 3) each, for `digest`.

    SHA-256 over weighted sums of `_SUMMED` words of 64 bits, four times as fast as over the words themselves.
    Collisions can be constructed deliberately; it serves to detect copies, not for security.
    """
    h = hashlib.sha256()
    for name, a in (("acc", acc), ("gyr", gyr), ("mag", mag)):
        if a is not None:
            h.update(f"{name}{len(a)}".encode())
            for part in cut_blocks(len(a)):
                bits = _bits(a[part]).ravel()
                end = len(bits) - len(bits) % (2 * _SUMMED)
                words = bits[:end].view(np.uint64)
                # the uppermost bit, the sign of every second number, has any odd weight alike
                words ^= words >> np.uint64(31)
                h.update(np.einsum("i,ij->j", _WEIGHTS, words.reshape(_SUMMED, -1)))
                h.update(bits[end:].tobytes())
    return h.hexdigest()


def _bits(a: Floats) -> NDArray[np.float32]:
    """float32 in C order with one bit pattern for NaN and one for zero."""
    with np.errstate(invalid="ignore"):  # a signalling NaN is NaN too
        b = np.add(a, np.float32(0), order="C", dtype=np.float32, casting="same_kind")
    missing = np.isnan(b)
    if missing.any():
        b[missing] = np.nan
    return b


def has_whole_row(signal: Floats) -> bool:
    """Whether any sample of (n, axes) is finite in all axes."""
    return any(is_complete(signal[part]).any() for part in cut_blocks(len(signal)))
