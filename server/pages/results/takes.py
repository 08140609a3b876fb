"""Side-by-side trials of one visit, for the overview of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sagittal.core.frames import SIDES
from sagittal.core.parameters.result import Parameter
from sagittal.server.report.view import level
from sagittal.server.report.view.table import ParameterRow
from sagittal.server.report.words.change_words import find_term
from sagittal.server.report.words.wording import format_number
from sagittal.server.results import visits
from sagittal.server.results.histories import AnalysedSession
from sagittal.server.results.reviewed import ReviewedAnalyses


def view_takes(
    reviewed: ReviewedAnalyses,
    done: Sequence[AnalysedSession],
    session_id: str,
    first: Sequence[ParameterRow],
) -> dict[str, Any] | None:
    """First values of every trial of this visit and their mean; None with a single trial."""
    visit = visits.find_visit_of(done, session_id)
    if visit is None or len(visit.takes) < 2:
        return None
    measured = visits.measure_visit(reviewed, visit)
    ids = [t.session.id for t in visit.takes]
    rows = []
    for row in first:
        name = level.from_standing(row.name) or row.name  # angles are relative to standing in each trial
        for side in (None, *SIDES):
            figure = measured.get((name, side))
            if figure is None or figure.mean.mean is None:
                continue
            digits = find_term(name).digits
            rows.append(
                {
                    "title": find_term(name).label,
                    "unit": find_term(name).unit,
                    "side": side,
                    "cells": [_print_take(figure.by_take.get(sid), digits) for sid in ids],
                    "mean": format_number(figure.mean.mean, digits),
                }
            )
    columns = [
        {"id": t.session.id, "title": t.session.title, "this": t.session.id == session_id}
        for t in visit.takes
    ]
    return {"columns": columns, "rows": rows}


def _print_take(p: Parameter | None, digits: int) -> str:
    if p is None or p.mean is None:
        return "–"
    spread = "" if p.sd is None else f" ± {format_number(p.sd, digits)}"
    return format_number(p.mean, digits) + spread
