"""View of squats: every repetition, and mean angle curves of the legs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.message import Message
from sagittal.core.squat.curves import VALGUS, cut_curves
from sagittal.core.squat.repetitions import FOOT_LIFTED
from sagittal.server.report.charts.curves import SQUAT, cycle_svg
from sagittal.server.report.charts.panels import CurvePanel, SideCurve
from sagittal.server.report.files.bundle import Bundle, StoredRepetition
from sagittal.server.report.words.wording import Variable, explain_repetition, format_number

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
"""Charts of a squat; the knee flexes more than in walking, so the axes differ."""

NORM_NOTE: Final = "There is no norm for squats."

SURE: Final = ("knee_flexion", "hip_flexion", "ankle_dorsiflexion")
"""Variables with a reliable offset (docs/science/squat.md, "Limits")."""


UNSURE_FIGURES: Final = ("squat_knee_valgus", "squat_hip_adduction", "squat_hip_rotation")
"""Prefixes of parameters derived from the other variables."""


@dataclass(frozen=True)
class RepetitionRow:
    """One squat in words; `excluded` is the reason for exclusion, in which case numbers are empty.

    Parameters
    ----------
    number : index among the squats of its leg.
    """

    number: int
    side: Side
    start: str
    depth: str
    valgus: str
    drop: str
    duration: str
    excluded: str | None


@dataclass(frozen=True)
class SquatSpan:
    """Period of a squat for the page's clock, s."""

    side: Side
    start_s: float
    end_s: float
    used: bool


@dataclass(frozen=True, eq=False)
class SquatView:
    """The squats of a trial.

    Parameters
    ----------
    sides : legs with squats. rows : in order of time. used : leg → number of included squats.
    lifted : leg → number of knee bends with the foot off the floor, which are not squats.
    charts : titles and drawings, empty without included squats. means_deg : variable → leg → (101,).
    spans : of all rows.
    """

    sides: tuple[Side, ...]
    rows: tuple[RepetitionRow, ...]
    used: Mapping[Side, int]
    lifted: Mapping[Side, int]
    charts: tuple[dict[str, object], ...]
    means_deg: Mapping[str, Mapping[Side, Floats]]
    spans: tuple[SquatSpan, ...]

    @property
    def title(self) -> str:
        """Legs that performed squats, in words."""
        return Message("{sides} leg", sides=self.sides[0]) if len(self.sides) == 1 else "both legs"

    @property
    def not_listed(self) -> str:
        """Repetitions not listed, in a sentence; empty if there are none."""
        legs = [
            Message("{value} of the {side} knee", value=n, side=side) for side, n in self.lifted.items() if n
        ]
        if not legs:
            return ""
        return Message(
            "Knee flexion with the foot off the floor is not counted as a squat: {legs}.",
            legs=" and ".join(legs),
        )

    def to_json(self) -> dict[str, object]:
        """Content of the report's JSON; curves are in angles.parquet, values in repetitions.csv."""
        return {
            "sides": self.sides,
            "used": self.used,
            "bends_with_lifted_foot": self.lifted,
            "repetitions": self.rows,
        }


def squat_view(bundle: Bundle) -> SquatView | None:
    """The squats of a finished analysis; None for other movements or without squats."""
    squats = [r for r in bundle.repetitions or () if r.excluded != FOOT_LIFTED]
    if not squats:
        return None
    lifted = Counter(r.side for r in bundle.repetitions or () if r.excluded == FOOT_LIFTED)
    numbers: Counter[Side] = Counter()
    rows = []
    for r in squats:
        numbers[r.side] += 1
        rows.append(_row(numbers[r.side], r))
    curves = {
        side: _curves(bundle, side, [r for r in squats if r.side == side and r.excluded is None])
        for side in SIDES
        if numbers[side]
    }
    panels = [p for v in VARIABLES if (p := _panel(v, curves)) is not None]
    return SquatView(
        sides=tuple(curves),
        rows=tuple(rows),
        used={side: sum(r.excluded is None for r in squats if r.side == side) for side in curves},
        lifted={side: lifted[side] for side in SIDES if lifted[side]},
        charts=tuple(
            {
                "title": p.title,
                "zero": "",
                "low": p.low_confidence,
                "reason": p.reason,
                "svg": cycle_svg(p, height=HEIGHT, x_unit=True, over=SQUAT),
            }
            for p in panels
        ),
        means_deg={
            p.variable.name: {s: c.mean_deg for s, c in p.sides.items() if c.mean_deg is not None}
            for p in panels
        },
        spans=tuple(SquatSpan(r.side, r.start_s, r.end_s, r.excluded is None) for r in squats),
    )


def _row(number: int, r: StoredRepetition) -> RepetitionRow:
    def words(name: str, digits: int) -> str:
        return format_number(r.values[name], digits) if name in r.values else "–"

    return RepetitionRow(
        number=number,
        side=r.side,
        start=format_number(r.start_s, 1),
        depth=words("squat_depth_deg", 0),
        valgus=words("squat_knee_valgus_deg", 0),
        drop=words("squat_hip_drop_m", 2),
        duration=words("squat_duration_s", 1),
        excluded=None if r.excluded is None else explain_repetition(r.excluded),
    )


def _curves(bundle: Bundle, side: Side, included: Sequence[StoredRepetition]) -> dict[str, Floats]:
    """Variable → (included, 101) degrees."""
    if bundle.angles is None or not included:
        return {}
    cycles = cut_curves(bundle.angles, side, [(r.start_s, r.end_s) for r in included])
    return {name: np.degrees(rows) for name, rows in cycles.items()}


def _panel(variable: Variable, curves: Mapping[Side, Mapping[str, Floats]]) -> CurvePanel | None:
    """Curves of a variable over the squats of each leg; None if no leg has any."""
    legs = {side: of_leg[variable.name] for side, of_leg in curves.items() if variable.name in of_leg}
    if not legs:
        return None
    sides, first = {}, 0
    for side, rows in legs.items():
        complete: Sequence[int] = np.flatnonzero(np.isfinite(rows).all(axis=1)).tolist()
        if complete:
            sides[side] = SideCurve(
                mean_deg=rows[complete].mean(axis=0),
                sd_deg=rows[complete].std(axis=0, ddof=1) if len(complete) > 1 else None,
                n=len(complete),
                strides={first + i: rows[i] for i in complete},
                foot_off_pct=None,
                foot_off_sd=None,
            )
        first += len(rows)
    return CurvePanel(
        variable=variable,
        title=variable.label,
        zero="standing",
        added_deg={},
        low_confidence=variable.name not in SURE,
        reason=None if sides else "not available throughout any squat",
        norm=None,
        norm_note="",
        sides=sides,
    )
