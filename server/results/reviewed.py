"""Current state of finished analyses: stored results combined with the edits in effect.

A stored analysis never changes. Current events, strides and parameters are recomputed from its tracks and
edits by the last function of the pipeline.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Collection, Hashable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar, cast

from sagittal.core.errors import FormatError
from sagittal.core.events.edits import Edit
from sagittal.core.norms.controls import ControlSession
from sagittal.core.parameters.measure import MeasuredGait, Tracks, measure_gait
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.rows import Column
from sagittal.server.errors import Conflict
from sagittal.server.export.kinds import EXPORTED
from sagittal.server.report.files import signals, tracks
from sagittal.server.report.files.bundle import Bundle, apply_review, load_bundle, read_columns
from sagittal.server.report.history.numbers import (
    Numbers,
    WalkMeans,
    means_of,
    numbers_of,
    read_means,
    read_numbers,
)
from sagittal.server.report.words.wording import speak_places
from sagittal.server.results import analyses
from sagittal.server.results.edit_log import EditHistory
from sagittal.server.storage.files.blobs import BlobStore, IntegrityError, StoreAway

_Value = TypeVar("_Value")

UNREADABLE: Final = (IntegrityError, StoreAway, FormatError)
"""Errors of a single visit in a list: its own page reports them, the others remain accessible."""

NOT_READ: Final = ("poses.parquet", signals.NAME)
"""Files that only the replay and the drawing of signals need."""

ANALYSES_KEPT, RESULTS_KEPT, PARTS_KEPT, PAGES_KEPT = 3, 12, 24, 24
NUMBERS_KEPT, CONTROLS_KEPT, VERDICTS_KEPT = 240, 500, 5000
"""Sizes of the caches of finished analyses, edited results, signals of one sensor and numbers. Ten minutes
take some 20 MB, 1 MB, 2 MB and 50 kB; a rendered page 1 MB, a verdict two words, a speed one row.
"""


@dataclass(frozen=True, eq=False)
class StoredAnalysis:
    """A finished analysis in memory; without `tracks` (earlier versions) it cannot be edited."""

    bundle: Bundle
    tracks: Tracks | None

    @property
    def fixed_because(self) -> str | None:
        """Reason why it cannot be edited, None if it can."""
        if self.tracks is not None:
            return None
        stopped = next((n.message for n in self.bundle.warnings if n.severity == "error"), None)
        if stopped is not None:
            return f"The analysis stopped before events were looked for. {speak_places(stopped)}"
        if self.bundle.repetitions is not None:
            return "Squats have no contacts or strides. The overview lists all squats."
        return (
            "This analysis was made by an earlier version that did not store the data needed for edits. "
            "Run the analysis again."
        )


class ReviewedAnalyses:
    """Current analyses of an installation, with a cache of those in use; thread-safe.

    Parameters
    ----------
    blobs : store of the result files.
    """

    def __init__(self, blobs: BlobStore) -> None:
        self.blobs = blobs
        self._analyses: RecentValues[StoredAnalysis] = RecentValues(ANALYSES_KEPT)
        self._results: RecentValues[MeasuredGait] = RecentValues(RESULTS_KEPT)
        self._numbers: RecentValues[Numbers] = RecentValues(NUMBERS_KEPT)
        self._controls: RecentValues[ControlSession] = RecentValues(CONTROLS_KEPT)
        self._verdicts: RecentValues[tuple[str, str]] = RecentValues(VERDICTS_KEPT)
        self._speeds: RecentValues[Parameter | None] = RecentValues(VERDICTS_KEPT)
        self._parts: RecentValues[Any] = RecentValues(PARTS_KEPT)
        self._pages: RecentValues[Any] = RecentValues(PAGES_KEPT)

    def open(self, record: analyses.AnalysisRecord) -> StoredAnalysis:
        """Return an analysis as stored, cached while in use; raises IntegrityError."""

        def read() -> StoredAnalysis:
            files = self._read_files(record, NOT_READ)
            stored = load_bundle(files)
            if tracks.NAME not in files:
                return StoredAnalysis(stored, None)
            return StoredAnalysis(
                stored, tracks.read_tracks(files[tracks.NAME], stored.events, stored.angles)
            )

        return self._analyses.get(record.id, read)

    def measure(self, record: analyses.AnalysisRecord, edits: EditHistory) -> MeasuredGait | None:
        """Return results recomputed with the edits; None without edits, when the stored results apply."""
        if not edits.made:
            return None
        return self._results.get((record.id, edits.key), lambda: self.measure_anew(record, edits.edits))

    def measure_anew(self, record: analyses.AnalysisRecord, edits: tuple[Edit, ...]) -> MeasuredGait:
        """Recompute with these edits, bypassing the cache.

        Raises
        ------
        Conflict no_tracks, IntegrityError, ParameterError of sagittal.core.events.edits.
        """
        stored = self.open(record)
        if stored.tracks is None:
            raise Conflict("no_tracks", stored.fixed_because or "")
        return measure_gait(stored.tracks, edits)

    def keep_result(self, record: analyses.AnalysisRecord, edits: EditHistory, result: MeasuredGait) -> None:
        """Cache the result of `measure_anew` for these edits."""
        self._results.put((record.id, edits.key), result)

    def read_columns(self, record: analyses.AnalysisRecord, edits: EditHistory) -> Mapping[str, Column]:
        """Return current values of all strides, by parameter; raises IntegrityError."""
        result = self.measure(record, edits)
        if result is not None:
            return result.columns
        if "strides.csv" not in record.files:
            return {}
        return read_columns(analyses.file_bytes(self.blobs, record, "strides.csv"))

    def read_bundle(self, record: analyses.AnalysisRecord, edits: EditHistory) -> Bundle:
        """Return the analysis with its edits applied; raises IntegrityError."""
        stored, result = self.open(record).bundle, self.measure(record, edits)
        return stored if result is None else apply_review(stored, result, edits.edits)

    def read_without_tracks(self, record: analyses.AnalysisRecord, edits: EditHistory) -> Bundle:
        """Return an analysis that is not being edited; without edits its tracks are neither read nor cached.

        Raises
        ------
        IntegrityError, FormatError as `read_bundle`.
        """
        if edits.made:
            return self.read_bundle(record, edits)
        return load_bundle(self._read_files(record, {*NOT_READ, tracks.NAME}))

    def _read_files(self, record: analyses.AnalysisRecord, left_out: Collection[str]) -> dict[str, bytes]:
        names = [n for n in record.files if n not in left_out and not n.startswith(EXPORTED)]
        return {name: analyses.file_bytes(self.blobs, record, name) for name in names}

    def read_numbers(self, record: analyses.AnalysisRecord, edits: EditHistory) -> Numbers:
        """Return current parameters and scores; without edits no signal is read.

        Raises
        ------
        IntegrityError
            a result file is damaged.
        """

        def read() -> Numbers:
            if not edits.made:
                stored = read_numbers(analyses.file_bytes(self.blobs, record, "analysis.json"))
                if stored is not None:
                    return stored
            return numbers_of(self.read_bundle(record, edits))

        return self._numbers.get((record.id, edits.key), read)

    def read_means(self, record: analyses.AnalysisRecord, edits: EditHistory) -> WalkMeans:
        """Return the contribution of a control's walk to a reference; without edits no angles are read.

        Raises
        ------
        IntegrityError, FormatError as `read_bundle`.
        """
        if not edits.made:
            stored = read_means(analyses.file_bytes(self.blobs, record, "analysis.json"))
            if stored is not None:
                return stored
        return means_of(self.read_without_tracks(record, edits))

    def read_verdict(self, record: analyses.AnalysisRecord, edits: EditHistory) -> tuple[str, str]:
        """Return symbol and word for the data quality of an analysis, for lists; raises IntegrityError."""
        return self._verdicts.get((record.id, edits.key), lambda: self.read_numbers(record, edits).verdict)

    def read_speed(self, record: analyses.AnalysisRecord, edits: EditHistory) -> Parameter | None:
        """Return the gait speed of an analysis, for lists; raises IntegrityError."""

        def read() -> Parameter | None:
            numbers = self.read_numbers(record, edits)
            return next((p for p in numbers.parameters if p.name == "gait_speed_mps"), None)

        return self._speeds.get((record.id, edits.key), read)

    def keep_part(self, key: tuple[str, ...], make_value: Callable[[], _Value]) -> _Value:
        """Cache a frequently used part by a key that begins with the analysis's id."""
        return cast("_Value", self._parts.get(key, make_value))

    def keep_control(
        self, record: analyses.AnalysisRecord, edits: EditHistory, make_value: Callable[[], ControlSession]
    ) -> ControlSession:
        """Cache the reference data of a finished analysis of a control."""
        return self._controls.get((record.id, edits.key), make_value)

    def keep_page(self, key: Hashable, make_value: Callable[[], _Value]) -> _Value:
        """Cache page content derived from analyses; `key` must identify all of them."""
        return cast("_Value", self._pages.get(key, make_value))

    def forget(self) -> None:
        """Clear all caches, so that erased data do not remain in memory."""
        for memory in (
            self._analyses,
            self._results,
            self._numbers,
            self._controls,
            self._parts,
            self._verdicts,
            self._speeds,
            self._pages,
        ):
            memory.clear()


class RecentValues(Generic[_Value]):
    """LRU cache of at most `size` values; thread-safe."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._values: OrderedDict[Hashable, _Value] = OrderedDict()
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._values)

    def clear(self) -> None:
        """Clear the cache."""
        with self._lock:
            self._values.clear()

    def get(self, key: Hashable, make_value: Callable[[], _Value]) -> _Value:
        """Return the value of a key, computing and caching it if absent."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
                return self._values[key]
        value = make_value()
        self.put(key, value)
        return value

    def put(self, key: Hashable, value: _Value) -> None:
        """Cache a value, evicting the least recently used one if full."""
        with self._lock:
            self._values[key] = value
            self._values.move_to_end(key)
            while len(self._values) > self._size:
                self._values.popitem(last=False)
