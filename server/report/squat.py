"""A take of squats on the session page: every repetition, and the courses of the leg's angles over it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from core.frames import Floats, Side
from core.squat.curves import VALGUS, cut_curves
from server.report.bundle import Bundle, StoredRepetition
from server.report.curves import SQUAT, cycle_svg
from server.report.panels import CurvePanel, SideCurve
from server.report.wording import Variable, explain_repetition, format_number

HEIGHT: Final = 158
"""Of a chart, px."""

BEND: Final = ((-30.0, 130.0), (0.0, 30.0, 60.0, 90.0, 120.0), "Flexion", "Extension")
FOOT: Final = ((-20.0, 60.0), (-20.0, 0.0, 20.0, 40.0, 60.0), "Dorsiflexion", "Plantarflexion")
IN: Final = ((-20.0, 40.0), (-20.0, 0.0, 20.0, 40.0), "Inward", "Outward")
ASIDE: Final = ((-25.0, 25.0), (-20.0, 0.0, 20.0), "Adduction", "Abduction")
TURN: Final = ((-30.0, 30.0), (-30.0, 0.0, 30.0), "Internal", "External")

VARIABLES: Final = (
    Variable("knee_flexion", "Knee flexion", "sagittal", *BEND),
    Variable("hip_flexion", "Hip flexion", "sagittal", *BEND),
    Variable("ankle_dorsiflexion", "Ankle dorsiflexion", "sagittal", *FOOT),
    Variable(VALGUS, "Dynamic knee valgus", "frontal", *IN),
    Variable("hip_adduction", "Hip adduction", "frontal", *ASIDE),
    Variable("hip_rotation", "Hip rotation", "transverse", *TURN),
)
"""Charts of a squat; the knee bends further than in walking, so the axes are their own."""

NORM_NOTE: Final = "Squats have no norm."

SURE: Final = ("knee_flexion", "hip_flexion", "ankle_dorsiflexion")
"""Of the others the level is not, or less surely, known (docs/science/squat.md, "Limits")."""


@dataclass(frozen=True)
class RepetitionRow:
    """One squat in words; `excluded` says why it does not count, and then the numbers are empty."""

    number: int
    start: str
    depth: str
    valgus: str
    drop: str
    duration: str
    excluded: str | None


@dataclass(frozen=True, eq=False)
class SquatView:
    """The squats of a leg; charts : titles and drawings, empty without a squat that counts."""

    side: Side
    rows: tuple[RepetitionRow, ...]
    charts: tuple[dict[str, object], ...]

    def to_json(self) -> dict[str, object]:
        """Plain values; curves lie in angles.parquet, every figure in repetitions.csv."""
        return {"side": self.side, "repetitions": [vars(row) for row in self.rows]}


def squat_view(bundle: Bundle) -> SquatView | None:
    """The squats of a finished analysis; None of another movement, and where nobody squatted."""
    if not bundle.repetitions:
        return None
    side = bundle.repetitions[0].side
    rows = tuple(_row(i + 1, r) for i, r in enumerate(bundle.repetitions))
    return SquatView(side, rows, _charts(bundle, side))


def _row(number: int, r: StoredRepetition) -> RepetitionRow:
    def words(name: str, digits: int) -> str:
        return format_number(r.values[name], digits) if name in r.values else "–"

    return RepetitionRow(
        number=number,
        start=format_number(r.start_s, 1),
        depth=words("squat_depth_deg", 0),
        valgus=words("squat_knee_valgus_deg", 0),
        drop=words("squat_hip_drop_m", 2),
        duration=words("squat_duration_s", 1),
        excluded=None if r.excluded is None else explain_repetition(r.excluded),
    )


def _charts(bundle: Bundle, side: Side) -> tuple[dict[str, object], ...]:
    counted = [r for r in bundle.repetitions or () if r.excluded is None]
    if bundle.angles is None or not counted:
        return ()
    curves = cut_curves(bundle.angles, side, [(r.start_s, r.end_s) for r in counted])
    drawn = [(v, np.degrees(curves[v.name])) for v in VARIABLES if v.name in curves]
    return tuple(
        {
            "title": v.label,
            "low": v.name not in SURE,
            "svg": cycle_svg(_panel(v, side, rows), height=HEIGHT, x_unit=True, over=SQUAT),
        }
        for v, rows in drawn
    )


def _panel(variable: Variable, side: Side, rows: Floats) -> CurvePanel:
    known: Sequence[int] = np.flatnonzero(np.isfinite(rows).all(axis=1)).tolist()
    curve = SideCurve(
        mean_deg=rows[known].mean(axis=0) if known else None,
        sd_deg=rows[known].std(axis=0, ddof=1) if len(known) > 1 else None,
        n=len(known),
        strides={i: rows[i] for i in known},
        foot_off_pct=None,
        foot_off_sd=None,
    )
    return CurvePanel(
        variable=variable,
        title=variable.label,
        zero="standing",
        added_deg={},
        low_confidence=variable.name not in SURE,
        reason=None if known else "not known throughout any squat",
        norm=None,
        norm_note="",
        sides={side: curve} if known else {},
    )
