"""gaitmap_foot for tests: the recording as a table at any rate, and its strides by motion capture."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.signal import butter, sosfiltfilt

from sagittal.core.formats import SourceFile, parse_manifest, read_recording
from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.signals.recording import Recording
from tests.data import data_folder
from tests.helpers.kept import keep_recorded

RATE = 204.8
COPIES = ("imu_sample.csv", "imu_sample_not_rotated.csv")
COLUMNS = [f"{side}_sensor/{kind}_{axis}" for side in SIDES for kind in ("acc", "gyr") for axis in "xyz"]

MOCAP_RATE = 100.0
MARKERS = ("TOE", "FCC", "FM5")
TURNING = np.radians(20.0)
"""Turn of the foot from one stance to the next beyond which a stride is a turning one: the straight ones turn
by 12° or less, the turning ones by 29° or more."""


@cache
def table(name: str) -> tuple[list[str], Floats]:
    """Column names and numbers of a file with two header rows."""
    rows = list(csv.reader(io.StringIO(data_folder("gaitmap_foot", name).read_text())))
    return [f"{a}/{b}" for a, b in zip(rows[0], rows[1], strict=True)], np.array(rows[2:], np.float64)


@cache
def signals(name: str) -> Floats:
    """Columns of one copy of the recording, (n, 12)."""
    header, numbers = table(name)
    return np.asarray(numbers[:, [header.index(c) for c in COLUMNS]])


def resampled(name: str, rate_hz: float) -> Floats:
    """The recording at another rate: low-pass at 0.45 of the new rate, linear interpolation."""
    x = signals(name)
    if rate_hz == RATE:
        return x
    t = np.arange(len(x)) / RATE
    x = sosfiltfilt(butter(4, 0.45 * rate_hz / (RATE / 2), output="sos"), x, axis=0)
    new = np.arange(0.0, t[-1], 1.0 / rate_hz)
    return np.stack([np.interp(new, t, c) for c in x.T], axis=1)


def block_mean(name: str) -> Floats:
    """The recording at half its rate, each sample the mean of two."""
    x = signals(name)
    return np.asarray(x[: len(x) // 2 * 2].reshape(-1, 2, x.shape[1]).mean(axis=1))


def recording_of(x: Floats, rate_hz: float) -> Recording:
    """Recording read from a table whose format only the manifest defines."""
    name = "feet.csv"
    data = "\n".join([",".join(COLUMNS), *(",".join(f"{v:.9g}" for v in row) for row in x)]).encode()
    columns = {
        f"foot_{side[0]}": {k: [f"{side}_sensor/{k}_{a}" for a in "xyz"] for k in ("acc", "gyr")}
        | {"mag": None}
        for side in SIDES
    }
    source = {
        "file": name, "header_rows": 1, "index_column": False, "rate_hz": rate_hz, "acc_unit": "m/s2",
        "gyr_unit": "deg/s", "gravity_included": True, "columns": columns,
    }  # fmt: skip
    manifest = parse_manifest(json.dumps({"protocol": "walk", "sources": [source]}).encode())
    return read_recording([SourceFile(name, len(data), lambda: data)], manifest)


@keep_recorded
def analysed() -> TakeAnalysis:
    """Analysis of the first recording."""
    return analyse(recording_of(signals(COPIES[0]), RATE))


@cache
def reference_strides(side: Side) -> tuple[dict[str, str], ...]:
    """Rows of the stride list of one foot, times in samples."""
    with data_folder("gaitmap_foot", "stride_events_sample.csv").open(newline="") as file:
        return tuple(r for r in csv.DictReader(file) if r["foot"] == side)


@dataclass(frozen=True)
class TrueStride:
    """A stride between two stances: times in s, horizontal way of the mean marker in m; turning or not.

    first_ic_s, last_ic_s : the initial contacts that begin these stances.
    """

    start_s: float
    end_s: float
    length_m: float
    turning: bool
    first_ic_s: float
    last_ic_s: float


@cache
def true_strides(side: Side) -> tuple[TrueStride, ...]:
    """Strides of one foot by motion capture, between the moments of least velocity."""
    header, numbers = table("mocap_sample.csv")
    foot = {m: numbers[:, [header.index(f"{side[0].upper()}_{m}/{a}") for a in "xy"]] / 1000 for m in MARKERS}
    mean = np.mean(list(foot.values()), axis=0)
    along = foot["TOE"] - foot["FCC"]
    heading = np.unwrap(np.arctan2(along[:, 1], along[:, 0]))
    t = np.arange(len(mean)) / MOCAP_RATE
    result = []
    for row in reference_strides(side):
        times = float(row["start"]) / RATE, float(row["end"]) / RATE
        a, b = (np.array([np.interp(s, t, c) for c in (*mean.T, heading)]) for s in times)
        length = float(np.linalg.norm(b[:2] - a[:2]))
        contacts = float(row["pre_ic"]) / RATE, float(row["ic"]) / RATE
        result.append(TrueStride(*times, length, bool(abs(b[2] - a[2]) > TURNING), *contacts))
    return tuple(result)
