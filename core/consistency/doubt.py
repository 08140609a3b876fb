"""Result of a consistency check: the notice, and the parameters that are suppressed because of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from sagittal.core.errors import Notice

Scope = Literal["between_feet", "all", "none"]
"""Parameters that need the contacts of both feet; all of a walk; none, a warning alone."""

LATE_FOOT: Final = "foot_late"
RATE: Final = "rate_doubtful"
NOT_WALKING: Final = "not_walking"
CONTRADICTED: Final = "feet_contradict"
"""Codes of the notices, and reasons of what is not reported."""
LAWS: Final = frozenset({LATE_FOOT, RATE, NOT_WALKING, CONTRADICTED})
"""Where one of them is among the notices, the data are at most usable."""


@dataclass(frozen=True)
class Doubt:
    """One broken law.

    Parameters
    ----------
    notice : with the size of the contradiction. scope : parameters that are not reported, with the code of
        the notice as their reason.
    """

    notice: Notice
    scope: Scope

    def to_json(self) -> dict[str, object]:
        """Plain values, as `read_doubt` takes them."""
        return {"notice": self.notice.to_json(), "scope": self.scope}


def read_doubt(values: Mapping[str, Any]) -> Doubt:
    """Read what `Doubt.to_json` wrote."""
    return Doubt(Notice.from_json(values["notice"]), values["scope"])
