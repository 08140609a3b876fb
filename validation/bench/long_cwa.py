"""A recording of days in the maker's format: real sectors again and again, their clocks going on."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sagittal.core.formats.vendors import cwa
from tests.data import data_folder

RATE = 50
ACTIVE_S = 720.0
"""Of every hour so much has all sectors of the recording in turn, the rest only its stillest ones."""

STILL = 8
"""Successive sectors that are repeated while nothing moves."""

START = np.datetime64("2026-11-02T00:00:00")


def write_long_cwa(path: Path, days: float) -> Path:
    """The sectors of a real AX3, as if it had recorded them at 50 Hz for so many days."""
    sample = (data_folder("formats") / "axivity" / "ax3_sample.cwa").read_bytes()
    heads, raw = cwa._whole_blocks(sample[cwa.HEADER :])
    words = raw[:, 30:510].copy().view("<u4")
    spread = np.linalg.norm(cwa._unpack(words), axis=2).std(axis=1)
    still = int(np.argmin(np.convolve(spread, np.ones(STILL), "valid")))
    with path.open("wb") as file:
        file.write(sample[: cwa.HEADER])
        total = round(days * 86400.0 * RATE / 120)
        for first in range(0, total, 4096):
            number = np.arange(first, min(total, first + 4096))
            active = number * (120.0 / RATE) % 3600.0 < ACTIVE_S
            sector = np.where(active, number % len(heads), still + number % STILL)
            file.write(_renew(raw[sector], number).tobytes())
    return path


def _renew(raw: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Sectors (b, 512) with the clock of the sectors of these numbers, and their check sums."""
    heads = raw.view(cwa._BLOCK)[:, 0]
    since = number * (120.0 / RATE)
    whole = np.floor(since)
    when = START + whole.astype("timedelta64[s]")
    days, months, years = (when.astype(f"datetime64[{unit}]") for unit in "DMY")
    second = (when - days).astype(np.int64)
    clock = (years.astype(np.int64) + 1970 - 2000) << 26
    clock |= ((months - years).astype(np.int64) + 1) << 22
    clock |= ((days - months).astype(np.int64) + 1) << 17
    clock |= (second // 3600 << 12) | (second // 60 % 60 << 6) | second % 60
    part = since - whole
    heads["clock"], heads["fraction"] = clock, 0x8000 | np.round(part * 32768).astype(np.int64)
    heads["rate"] = 0x49
    heads["offset"] = -np.floor((heads["fraction"] & 0x7FFF) / 32768.0 * RATE)
    words = raw.view("<u2")
    words[:, -1] = 0
    words[:, -1] = (-words.sum(axis=1, dtype=np.int64)) & 0xFFFF
    return raw
