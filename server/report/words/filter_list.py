"""Available orientation filters in words: engines, grades, use of magnetometers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from sagittal.core.estimators import PaperReference
from sagittal.core.fusion.algorithms.choice import OWN
from sagittal.core.fusion.algorithms.listed import ALGORITHMS, ENGINES, GRADES

OWN_ENGINE: Final = "Sagittal"
"""Group of our own filters, next to the six engines."""

NEEDS: Final[Mapping[str, str]] = {"needed": "needs a magnetometer", "unused": "uses no magnetometer"}
"""Deviations from the rule that most filters use a magnetometer if available."""

PROPOSED: Final = (
    *(o.name for o in OWN), "madgwick_2011_imu", "choukroun_2006", "sabatini_2006", "srckf", "markley_2003",
    "hyyti_2015",
)  # fmt: skip
"""Default selection: our own, and one of each engine that works without a magnetometer."""


@dataclass(frozen=True)
class ListedFilter:
    """A filter as offered in forms.

    Parameters
    ----------
    name : identifier. label : display name, which marks reconstructions. engine : its group.
    grade : certainty of its equations, None for our own. magnetometer : needed, optional or unused.
    """

    name: str
    label: str
    engine: str
    grade: str | None
    magnetometer: str
    paper: PaperReference | None

    @property
    def remark(self) -> str:
        """Grade, and use of a magnetometer if unusual."""
        grade = None if self.grade is None else GRADES_IN_WORDS[self.grade]
        return ", ".join(x for x in (grade, NEEDS.get(self.magnetometer)) if x)


GRADES_IN_WORDS: Final[Mapping[str, str]] = {grade: f"{grade}, {words}" for grade, words in GRADES.items()}

ENGINE_WORDS: Final[Mapping[str, str]] = {
    OWN_ENGINE: "Self-calibrating, our own",
    **{engine: words[0].upper() + words[1:] for engine, words in ENGINES.items()},
}

FILTERS: Final = (
    *(ListedFilter(o.name, o.label, OWN_ENGINE, None, "optional", None) for o in OWN),
    *(ListedFilter(a.name, a.shown, a.engine, a.grade, a.magnetometer, a.paper) for a in ALGORITHMS),
)


def list_engines() -> list[tuple[str, str, list[ListedFilter]]]:
    """Engines with label and filters, in display order."""
    return [(e, words, [f for f in FILTERS if f.engine == e]) for e, words in ENGINE_WORDS.items()]
