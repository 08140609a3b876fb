"""Signals of a finished analysis for display: named lanes, downsampled to screen resolution.

Derived: pitch, angular rate and height of the feet, every joint angle. Raw: measurements of each sensor in
its own axes. A window of a lane is returned as minimum and maximum of equal bins, so that peaks are preserved
at any zoom.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import pyarrow.parquet as pq
from pyarrow import BufferReader

from sagittal.core.events.foot_pitch import pitch_signal
from sagittal.core.frames import FOOT, SEGMENTS, SIDES, SUFFIX, Floats, Segment
from sagittal.server.errors import NotFound
from sagittal.server.report.files import signals as file
from sagittal.server.report.files.columns import floats_of
from sagittal.server.report.words.wording import VARIABLES, place_words
from sagittal.server.results import analyses
from sagittal.server.results.reviewed import ReviewedAnalyses, StoredAnalysis

MOST_POINTS: Final = 4000
"""Maximum number of bins of a window: the width of the widest screens in pixels."""

AXES: Final = ("x", "y", "z")
DIGITS: Final = 3


@dataclass(frozen=True)
class SignalLane:
    """A signal over time, drawn in one diagram.

    Parameters
    ----------
    lines : its curves: "left", "right" or "x", "y", "z". up : meaning of positive values, in words.
    raw : measurement of one sensor.
    """

    name: str
    label: str
    unit: str
    up: str
    lines: tuple[str, ...]
    raw: bool


@dataclass(frozen=True, eq=False)
class SignalWindow:
    """A window of a lane.

    Parameters
    ----------
    start_s, step_s : time of the first bin and bin width.
    low, high : line → minimum and maximum of every bin, None where the sensor was lost.
    """

    lane: SignalLane
    start_s: float
    step_s: float
    low: Mapping[str, list[float | None]]
    high: Mapping[str, list[float | None]]


def list_lanes(reviewed: ReviewedAnalyses, record: analyses.AnalysisRecord) -> tuple[SignalLane, ...]:
    """Signals available for an analysis: feet first, then joints from proximal to distal, then sensors."""
    stored = reviewed.open(record)
    return tuple(lane for lane, _ in _lanes(reviewed, record, stored))


def read_window(
    reviewed: ReviewedAnalyses,
    record: analyses.AnalysisRecord,
    name: str,
    start_s: float,
    end_s: float,
    points: int,
) -> SignalWindow:
    """A window of a lane in at most `points` bins; raises NotFound for an unknown lane."""
    stored = reviewed.open(record)
    drawn = next(((lane, read) for lane, read in _lanes(reviewed, record, stored) if lane.name == name), None)
    if drawn is None:
        raise NotFound("signal", name)
    lane, read = drawn
    t_s, lines = read()
    n = len(t_s)
    rate = (n - 1) / (t_s[-1] - t_s[0]) if n > 1 else 1.0
    first = min(max(math.floor((start_s - t_s[0]) * rate), 0), n - 1)
    past = min(max(math.ceil((end_s - t_s[0]) * rate) + 1, first + 1), n)
    size = max(1, math.ceil((past - first) / min(points, MOST_POINTS)))
    low, high = {}, {}
    for line, values in lines.items():
        low[line], high[line] = _extremes(values[first:past], size)
    return SignalWindow(lane, float(t_s[first]), size / rate, low, high)


Read = Callable[[], tuple[Floats, Mapping[str, Floats]]]


def _lanes(
    reviewed: ReviewedAnalyses, record: analyses.AnalysisRecord, stored: StoredAnalysis
) -> Iterator[tuple[SignalLane, Read]]:
    yield from _foot_lanes(reviewed, record, stored)
    yield from _angle_lanes(stored)
    yield from _raw_lanes(reviewed, record)


def _foot_lanes(
    reviewed: ReviewedAnalyses, record: analyses.AnalysisRecord, stored: StoredAnalysis
) -> Iterator[tuple[SignalLane, Read]]:
    tracks = stored.tracks
    if tracks is None:
        return
    sides = tuple(side for side in SIDES if FOOT[side] in tracks.q)
    if sides:

        def pitch() -> tuple[Floats, Mapping[str, Floats]]:
            lines: dict[str, Floats] = {}
            for side in sides:
                angle = np.degrees(np.arcsin(np.clip(pitch_signal(tracks.q[FOOT[side]]), -1.0, 1.0)))
                lines[side] = np.where(tracks.valid[FOOT[side]], angle, np.nan)
            return tracks.t_s, lines

        yield SignalLane("foot_pitch", "Foot pitch", "°", "toes up", sides, raw=False), pitch
    turned = (stored.bundle.calibration or {}).get("segments") or {}
    if sides and file.NAME in record.files and all(FOOT[side] in turned for side in sides):

        def rate() -> tuple[Floats, Mapping[str, Floats]]:
            lines: dict[str, Floats] = {}
            t_s = tracks.t_s
            for side in sides:
                mounted = turned[FOOT[side]]
                t_s, axes = _raw(reviewed, record, FOOT[side], "gyr")
                bias = np.array([b or 0.0 for b in mounted["gyro_bias_dps"]])
                # the segment's z axis points to the right: rotation about it lifts the toes
                lateral = np.array(mounted["R_segment_sensor"])[2]
                lines[side] = (np.stack([axes[c] for c in AXES], axis=1) - bias) @ lateral
            return t_s, lines

        def strength() -> tuple[Floats, Mapping[str, Floats]]:
            lines: dict[str, Floats] = {}
            t_s = tracks.t_s
            for side in sides:
                t_s, axes = _raw(reviewed, record, FOOT[side], "acc")
                lines[side] = np.sqrt(sum(axes[c] ** 2 for c in AXES))
            return t_s, lines

        yield SignalLane("foot_rate", "Foot turning rate", "°/s", "toes rise", sides, raw=False), rate
        yield SignalLane("foot_acceleration", "Foot acceleration", "m/s²", "more", sides, raw=False), strength
    feet = tracks.feet
    if feet is not None and feet.p:
        placed = tuple(side for side in SIDES if side in feet.p)

        def height() -> tuple[Floats, Mapping[str, Floats]]:
            return feet.t_s, {str(s): np.where(feet.valid[s], feet.p[s][:, 2], np.nan) for s in placed}

        yield SignalLane("foot_height", "Ankle height", "m", "higher", placed, raw=False), height


def _angle_lanes(stored: StoredAnalysis) -> Iterator[tuple[SignalLane, Read]]:
    angles = stored.bundle.angles
    if angles is None:
        return
    for variable in VARIABLES:
        names: dict[str, str] = {side: f"{variable.name}_{SUFFIX[side]}" for side in SIDES}
        if variable.name in angles.angles:
            names = {"both": variable.name}
        lines = {line: angles.angles[name] for line, name in names.items() if name in angles.angles}
        if lines:

            def read(lines: Mapping[str, Floats] = lines) -> tuple[Floats, Mapping[str, Floats]]:
                return angles.t_s, {line: np.degrees(values) for line, values in lines.items()}

            yield (
                SignalLane(variable.name, variable.label, "°", variable.up.lower(), tuple(lines), raw=False),
                read,
            )


def _raw_lanes(
    reviewed: ReviewedAnalyses, record: analyses.AnalysisRecord
) -> Iterator[tuple[SignalLane, Read]]:
    if file.NAME not in record.files:
        return
    names = set(_columns(reviewed, record))
    for segment in SEGMENTS:
        for kind, label, unit in (("gyr", "angular rate", "°/s"), ("acc", "acceleration", "m/s²")):
            if f"{segment}_{kind}_x{_ENDING[kind]}" not in names:
                continue

            def read(segment: Segment = segment, kind: str = kind) -> tuple[Floats, Mapping[str, Floats]]:
                return _raw(reviewed, record, segment, kind)

            words = place_words(segment).capitalize()
            yield SignalLane(f"{segment}_{kind}", f"{words}, {label}", unit, "more", AXES, raw=True), read


_ENDING: Final = {"gyr": "_dps", "acc": ""}


def _columns(reviewed: ReviewedAnalyses, record: analyses.AnalysisRecord) -> tuple[str, ...]:
    def read() -> tuple[str, ...]:
        content = analyses.file_bytes(reviewed.blobs, record, file.NAME)
        return tuple(pq.read_schema(BufferReader(content)).names)

    return reviewed.keep_part((record.id, "columns"), read)


def _raw(
    reviewed: ReviewedAnalyses, record: analyses.AnalysisRecord, segment: Segment, kind: str
) -> tuple[Floats, Mapping[str, Floats]]:
    """The three axes of a sensor, cached as signals are usually viewed repeatedly."""

    def read() -> tuple[Floats, Mapping[str, Floats]]:
        names = {c: f"{segment}_{kind}_{c}{_ENDING[kind]}" for c in AXES}
        content = analyses.file_bytes(reviewed.blobs, record, file.NAME)
        table = pq.ParquetFile(BufferReader(content)).read(columns=["t_s", *names.values()])
        return floats_of(table, "t_s"), {c: floats_of(table, name) for c, name in names.items()}

    return reviewed.keep_part((record.id, segment, kind), read)


def _extremes(values: Floats, size: int) -> tuple[list[float | None], list[float | None]]:
    """Minimum and maximum of successive bins of `size` samples; the last one may be shorter."""
    if size == 1:
        same = _plain(values)
        return same, same
    full = np.full(math.ceil(len(values) / size) * size, np.nan)
    full[: len(values)] = values
    parts = full.reshape(-1, size)
    low = np.fmin.reduce(parts, axis=1)
    high = np.fmax.reduce(parts, axis=1)
    return _plain(low), _plain(high)


def _plain(values: Floats) -> list[float | None]:
    rounded = np.round(values, DIGITS)
    cells: list[float | None] = rounded.tolist()
    for i in np.flatnonzero(~np.isfinite(rounded)):
        cells[i] = None
    return cells
