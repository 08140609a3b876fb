"""The kinematic walk as content of an export."""

from __future__ import annotations

from collections.abc import Mapping

from sagittal.core.events.edits import Edit
from sagittal.server.export.content import ExportContent, VisitFacts, open_content
from tests.server import analysed

FACTS = VisitFacts("s1", "=HYPERLINK(1)", "v1", "2026-03-02", sex="female", age_years=60, height_m=1.7)


def open_walk(*edits: Edit, files: Mapping[str, bytes] | None = None) -> ExportContent:
    """The walk, or another analysis, with a person's edits."""
    inputs = analysed.files() if files is None else files
    return open_content({name: lambda x=x: x for name, x in inputs.items()}, FACTS, edits)  # type: ignore[misc]
