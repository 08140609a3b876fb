"""Input of an export: analysis files, edits, and pseudonymized facts about the visit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Self

import pyarrow as pa

from sagittal.core.body.poses import Poses
from sagittal.core.errors import FormatError
from sagittal.core.events.edits import Edit
from sagittal.core.frames import Protocol, Side
from sagittal.core.parameters.kinematic import cycle_curves
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.parameters.result import Parameter
from sagittal.core.parameters.rows import Column
from sagittal.server.report.files import signals, tracks
from sagittal.server.report.files.analysis_json import parameter_row
from sagittal.server.report.files.bundle import Bundle, apply_review, load_bundle, read_columns, read_poses
from sagittal.server.report.files.columns import read_table
from sagittal.server.report.history.numbers import numbers_of
from sagittal.server.report.view.level import level_column, level_parameters
from sagittal.server.report.words.estimator import list_estimated_angles, list_estimated_variables

POSES = "poses.parquet"
LATER = (POSES, signals.NAME, tracks.NAME)
"""Files read only by exports that need them."""


@dataclass(frozen=True)
class VisitFacts:
    """Facts about patient and visit for an export, without name or date of birth.

    Parameters
    ----------
    subject : stable pseudonym for data sets, letters and digits. code : the clinic's own pseudonym.
    visit : stable name of the visit for data sets. day : ISO date of the visit, None = withheld.
    age_years, height_m, sex, affected_side : None if unknown.
    condition : walking condition, in words. version : of the exporting software.
    """

    subject: str = "anonymous"
    code: str = ""
    visit: str = "1"
    day: str | None = None
    protocol: Protocol = "walk"
    sex: str | None = None
    age_years: int | None = None
    height_m: float | None = None
    affected_side: Side | None = None
    condition: str = ""
    version: str = ""

    @classmethod
    def of_json(cls, values: Mapping[str, Any]) -> Self:
        """Create from job parameters; unknown keys are ignored."""
        names = {f.name for f in fields(cls)}
        return cls(**{k: v for k, v in values.items() if k in names})


@dataclass(frozen=True, eq=False)
class SignedForm:
    """The signed report of a visit for an export.

    Parameters
    ----------
    version : of the report, from 1. language : of its text. signed_at : ISO date and time.
    of_these_numbers : False if the results changed after signing.
    documents : media type and content, the printable one first.
    """

    version: int
    language: str
    signed_by: str | None
    signed_at: str
    of_these_numbers: bool
    documents: tuple[tuple[str, bytes], ...]


@dataclass(frozen=True)
class CycleRow:
    """A stride, or a squat, with its parameters.

    Parameters
    ----------
    number : from 1, in order of the list. turn_deg : None if unknown. values : parameter → number, None if
        undefined. flags : exclusion rules that apply. excluded : reason for exclusion, None = included.
    """

    number: int
    side: Side
    start_s: float
    end_s: float
    tc_s: float | None
    values: Mapping[str, float | None]
    flags: tuple[str, ...]
    excluded: str | None


@dataclass(frozen=True, eq=False)
class ExportContent:
    """A finished analysis including edits.

    Parameters
    ----------
    files : of `sagittal.server.report.files.exports`, name → reader of its bytes.
    bundle : with the edits applied.
    columns : parameters of all strides. edits : edits in effect.
    signed : the report in force, None if absent or not part of the format.
    """

    visit: VisitFacts
    files: Mapping[str, Callable[[], bytes]]
    bundle: Bundle
    columns: Mapping[str, Column] = field(default_factory=dict)
    edits: tuple[Edit, ...] = ()
    signed: SignedForm | None = None

    @cached_property
    def poses(self) -> Poses:
        """Segment poses; raises FormatError `export_not_possible` if there are none."""
        return read_poses(self.read_needed(POSES))

    @property
    def estimated(self) -> tuple[str, ...]:
        """Angles with their side that are estimated by a leg model rather than measured by two sensors."""
        return tuple(sorted(list_estimated_angles(self.bundle.estimator)))

    @property
    def verdict(self) -> str:
        """Data quality as shown on the session page, in words."""
        return numbers_of(self.bundle).verdict[1]

    @property
    def has_poses(self) -> bool:
        """Whether the files include segment poses."""
        return POSES in self.files

    @cached_property
    def signals(self) -> tuple[pa.Table, dict[str, Any]]:
        """Sensor signals on a common time axis and their metadata; raises like `poses`."""
        return read_table(self.read_needed(signals.NAME))

    @cached_property
    def levels(self) -> tuple[Parameter, ...]:
        """Parameters relative to the anatomical zero, if goniometer angles were entered."""
        angles = self.bundle.angles
        if angles is None or not angles.standing_deg:
            return ()
        curves = cycle_curves(angles, self.bundle.strides)
        return level_parameters(curves, angles.standing_deg, list_estimated_variables(self.bundle.estimator))

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the trial over the included strides; those relative to the anatomical zero
        come last.
        """
        return (*self.bundle.parameters, *self.levels)

    @cached_property
    def cycles(self) -> tuple[CycleRow, ...]:
        """All strides or squats, included or not."""
        if self.bundle.repetitions is not None:
            return tuple(
                CycleRow(i + 1, r.side, r.start_s, r.end_s, None, r.values, (), r.excluded)
                for i, r in enumerate(self.bundle.repetitions)
            )
        strides, angles = self.bundle.strides, self.bundle.angles
        standing = {} if angles is None else angles.standing_deg
        columns = dict(self.columns)
        for name in dict.fromkeys(p.name for p in self.levels):
            column = level_column(name, strides, self.columns, standing)
            if column is not None:
                columns[name] = column
        return tuple(
            CycleRow(
                i + 1,
                s.side,
                s.start_s,
                s.end_s,
                s.tc_s,
                {name: column[i] for name, column in columns.items()},
                s.flags,
                s.excluded_reason,
            )
            for i, s in enumerate(strides.strides)
        )

    def read_needed(self, name: str) -> bytes:
        """Read a required result file; raises FormatError `export_not_possible`."""
        if name not in self.files:
            raise FormatError(
                "export_not_possible",
                f"This analysis has no {name}, which the export is made from. Run the analysis again, or "
                "choose another format.",
            )
        return self.files[name]()


def open_content(
    files: Mapping[str, Callable[[], bytes]], visit: VisitFacts, edits: Sequence[Edit] = ()
) -> ExportContent:
    """Read an analysis and recompute its parameters with the user's edits.

    Parameters
    ----------
    files : name → reader of its bytes.

    Raises
    ------
    FormatError `no_analysis`, `newer_analysis`; `export_not_possible` if edits cannot be applied.
    """
    stored = load_bundle({name: read() for name, read in files.items() if name not in LATER})
    content = ExportContent(visit, files, stored, edits=tuple(edits))
    if not edits:
        columns = read_columns(files["strides.csv"]()) if "strides.csv" in files else {}
        return replace(content, columns=columns)
    stored_tracks = tracks.read_tracks(content.read_needed(tracks.NAME), stored.events, stored.angles)
    measured = measure_gait(stored_tracks, edits)
    reviewed = apply_review(stored, measured, edits)
    # as stored by an analysis: non-finite values are undefined
    rows: list[dict[str, Any]] = [parameter_row(p) for p in reviewed.parameters]
    reviewed = replace(reviewed, parameters=tuple(Parameter(**row) for row in rows))
    return replace(content, bundle=reviewed, columns=measured.columns)
