"""Grouping of changes: parameters that are equivalent by definition count as one change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from sagittal.core.change.verdict import Change
from sagittal.core.frames import Side
from sagittal.core.parameters.catalogue import CATALOGUE, require_entries
from sagittal.core.parameters.flats import OTHER

Fact = tuple[str, Side | None]
"""What changed: the figure that stands for it, and the side."""

SAME_AS: Final[Mapping[str, tuple[str, Literal["own", "other", "take"]]]] = {
    "swing_pct": ("stance_pct", "own"),
    "single_support_pct": ("stance_pct", "other"),
    "terminal_double_support_pct": ("initial_double_support_pct", "other"),
    "single_support_s": ("swing_time_s", "other"),
    "terminal_double_support_s": ("initial_double_support_s", "other"),
    "stride_time_s": ("cadence_spm", "take"),
}
"""Figure → the one that says the same by its definition, of which leg; "take": of both together.

The rest of a stride is swing, a foot stands alone while the other swings, and two steps are a stride.
"""

require_entries((*SAME_AS, *(to for to, _ in SAME_AS.values())), "sagittal.core.change.facts")


@dataclass(frozen=True)
class ChangedFact:
    """A change larger than the measurement error.

    Parameters
    ----------
    change : of the representative parameter. same : equivalent real changes, in the order given.
    """

    change: Change
    same: tuple[Change, ...] = ()

    @property
    def relevant(self) -> bool:
        """Whether any of its parameters changed by a clinically relevant amount."""
        return any(c.verdict == "clinically_relevant" for c in (self.change, *self.same))


@dataclass(frozen=True)
class SortedChanges:
    """The changes between two sessions, equivalent parameters grouped.

    Parameters
    ----------
    real : changes larger than the measurement error, in the order given. within : number of groups within it.
    unjudged : number of groups with a difference but no verdict.
    """

    real: tuple[ChangedFact, ...] = ()
    within: int = 0
    unjudged: int = 0


def name_fact(name: str, side: Side | None) -> Fact:
    """Group that a parameter of one side belongs to; parameters shared by both sides have no side."""
    to, relation = SAME_AS.get(name, (name, "own"))
    entry = CATALOGUE.get(to)
    if relation == "take" or side is None or (entry is not None and entry.shared):
        return to, None
    return to, OTHER[side] if relation == "other" else side


def sort_changes(changes: Sequence[Change]) -> SortedChanges:
    """Sort changes by their verdict; a group is real if any parameter in it is.

    Changes without a difference are omitted.
    """
    facts: dict[Fact, list[Change]] = {}
    for c in changes:
        if c.difference is not None:
            facts.setdefault(name_fact(c.name, c.side), []).append(c)
    real, within_error, unjudged = [], 0, 0
    for group in facts.values():
        beyond = [c for c in group if c.verdict in {"real_change", "clinically_relevant"}]
        if beyond:
            real.append(ChangedFact(beyond[0], tuple(beyond[1:])))
        elif any(c.verdict is not None for c in group):
            within_error += 1
        else:
            unjudged += 1
    return SortedChanges(tuple(real), within_error, unjudged)
