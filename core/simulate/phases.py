"""Named stretches of a recording: activity with start and end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Phase:
    """An activity from `start_s` to `end_s`."""

    kind: str
    start_s: float
    end_s: float


def phase_table(phases: Sequence[Phase]) -> dict[str, list[float] | list[str]]:
    """`start_s`, `end_s` and `kind` as columns, in chronological order."""
    return {
        "start_s": [p.start_s for p in phases],
        "end_s": [p.end_s for p in phases],
        "kind": [p.kind for p in phases],
    }
