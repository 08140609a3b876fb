"""A finished analysis as tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import degrees, nan

import numpy as np
import pyarrow as pa

from sagittal.core import pipeline
from sagittal.core.errors import Notice
from sagittal.core.frames import Floats, Side
from sagittal.core.parameters.result import Parameter

NUMBERS = ("mean", "sd", "cv_pct", "ci_low", "ci_high", "uncertainty", "u_own", "u_common")
"""Columns of the parameter table that hold a number or null."""


@dataclass(frozen=True, eq=False)
class Analysis:
    """Result of `analyse`; tables of stages that were not reached are empty.

    Tables are pyarrow tables; `table.to_pandas()` returns a data frame, `table["x"].to_numpy()` a column as
    an array. Undefined values are null.
    """

    _found: pipeline.TakeAnalysis

    @property
    def problem(self) -> Notice | None:
        """Error that stopped the pipeline: code, message, sensor, time; None if every stage ran."""
        return self._found.problem

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Notices of all stages, in pipeline order."""
        return self._found.notices

    @property
    def quality(self) -> str:
        """Quality level of the signals: "good", "usable" or "poor"."""
        return self._found.quality.level

    @property
    def estimator(self) -> str | None:
        """Method of the pose estimator used (docs/reference/estimators.md); None if none ran."""
        return None if self._found.poses is None else self._found.poses.method

    @property
    def provenance(self) -> Mapping[str, object]:
        """SHA-256 of every input file and digest of all parameters."""
        return self._found.provenance

    @property
    def angles(self) -> pa.Table:
        """`t_s` and each angle, `<name>_deg`; NaN where a sensor was lost; docs/reference/parameters.md."""
        angles = self._found.angles
        if angles is None:
            return pa.table({"t_s": np.zeros(0)})
        columns = {f"{name}_deg": np.degrees(x) for name, x in angles.angles.items()}
        return pa.table({"t_s": angles.t_s, **columns})

    @property
    def events(self) -> pa.Table:
        """Contacts: `time_s`, `side`, `kind` (ic, tc), `source`, `confidence`."""
        events = () if self._found.events is None else self._found.events.events
        return pa.table(
            {
                "time_s": pa.array([e.time_s for e in events], pa.float64()),
                "side": pa.array([e.side for e in events], pa.string()),
                "kind": pa.array([e.kind for e in events], pa.string()),
                "source": pa.array([e.source for e in events], pa.string()),
                "confidence": pa.array([e.confidence for e in events], pa.float64()),
            }
        )

    @property
    def strides(self) -> pa.Table:
        """Every stride: `side`, times in s, `turn_deg`, its parameters, `excluded_reason` (null = counts)."""
        measured = self._found.measured
        strides = () if measured is None else measured.strides.strides
        columns = {
            "side": pa.array([s.side for s in strides], pa.string()),
            "start_s": pa.array([s.start_s for s in strides], pa.float64()),
            "tc_s": pa.array([s.tc_s for s in strides], pa.float64()),
            "end_s": pa.array([s.end_s for s in strides], pa.float64()),
            "turn_deg": pa.array(
                [None if s.turn_rad is None else degrees(s.turn_rad) for s in strides], pa.float64()
            ),
        }
        for name, column in ({} if measured is None else measured.columns).items():
            columns[name] = pa.array(list(column))
        columns["excluded_reason"] = pa.array([s.excluded_reason for s in strides], pa.string())
        return pa.table(columns)

    @property
    def parameters(self) -> pa.Table:
        """One row per parameter and side: `name`, `side`, `n`, `mean`, `sd`, `unit`, `reason` …"""
        rows = [asdict(p) for p in self._found.parameters]
        kinds = {name: pa.float64() for name in NUMBERS} | {"n": pa.int64(), "estimated": pa.bool_()}
        names = tuple(Parameter.__dataclass_fields__)
        return pa.table(
            {name: pa.array([r[name] for r in rows], kinds.get(name, pa.string())) for name in names}
        )

    def parameter(self, name: str, side: Side | None = None) -> float:
        """Mean of one parameter, NaN if undefined; raises KeyError for an unknown name."""
        for p in self._found.parameters:
            if (p.name, p.side) == (name, side):
                return nan if p.mean is None else p.mean
        raise KeyError(name if side is None else (name, side))

    def angle(self, name: str) -> tuple[Floats, Floats]:
        """Times (n,) in s and one joint angle (n,) in degrees, as numpy arrays; raises KeyError."""
        angles = self._found.angles
        if angles is None or name not in angles.angles:
            raise KeyError(name)
        return angles.t_s, np.degrees(angles.angles[name])
