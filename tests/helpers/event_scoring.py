"""One-to-one matching of found and reference events (docs/science/events.md, "Scoring")."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sagittal.core.frames import Floats

WINDOW_S = 0.5


@dataclass(frozen=True, eq=False)
class Score:
    """Errors (found − reference, s) of the pairs, how many references were missed, events without a pair."""

    errors: Floats
    missed: int
    extra: tuple[float, ...]

    @property
    def mean_ms(self) -> float:
        """Mean error, ms."""
        return 1e3 * float(np.mean(self.errors))

    @property
    def sd_ms(self) -> float:
        """Standard deviation of the error, ms."""
        return 1e3 * float(np.std(self.errors, ddof=1))


def match(result: Sequence[float], reference: Sequence[float], window_s: float = WINDOW_S) -> Score:
    """Pair each reference with the nearest found event within the window, nearest pairs first."""
    pairs = sorted(
        (abs(f - r), i, j)
        for i, f in enumerate(result)
        for j, r in enumerate(reference)
        if abs(f - r) <= window_s
    )
    taken_found: set[int] = set()
    taken_reference: dict[int, int] = {}
    for _, i, j in pairs:
        if i not in taken_found and j not in taken_reference:
            taken_found.add(i)
            taken_reference[j] = i
    errors = np.array([result[i] - reference[j] for j, i in sorted(taken_reference.items())])
    extra = tuple(f for i, f in enumerate(result) if i not in taken_found)
    return Score(errors, len(reference) - len(errors), extra)
