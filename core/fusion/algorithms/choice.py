"""All selectable filters: the published ones and those of this project."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from sagittal.core.errors import ParameterError
from sagittal.core.fusion.algorithms.listed import ALGORITHMS, BY_NAME
from sagittal.core.message import Message


@dataclass(frozen=True)
class OwnFilter:
    """The project's self-calibrating filter, in addition to the published ones; `both_ways`: smoothed,
    offline only.
    """

    name: str
    label: str
    both_ways: bool


OWN: Final = (
    OwnFilter("sagittal_live", "Sagittal, live", both_ways=False),
    OwnFilter("sagittal_both_ways", "Sagittal, both ways", both_ways=True),
)

LABELS: Final[dict[str, str]] = {a.name: a.shown for a in ALGORITHMS} | {o.name: o.label for o in OWN}
"""Every filter that can be asked for, as it is shown to people."""


def require_filters(names: Sequence[str]) -> None:
    """Reject an empty selection of filters, or an unknown filter.

    Raises
    ------
    ParameterError `no_filter`, `no_such_algorithm`.
    """
    if not names:
        raise ParameterError("no_filter", "No filter was chosen; choose at least one.")
    unknown = next((name for name in names if name not in LABELS), None)
    if unknown is not None:
        raise ParameterError(
            "no_such_algorithm", Message("There is no filter '{unknown}'; see the list.", unknown=unknown)
        )


def require_tunable(name: str) -> None:
    """Reject an unknown filter, or one without gains to fit: the project's own estimates its parameters.

    Raises
    ------
    ParameterError `no_such_algorithm`, `nothing_to_tune`.
    """
    if any(name == own.name for own in OWN):
        raise ParameterError(
            "nothing_to_tune",
            Message("'{name}' calibrates itself, it has no gains to fit; choose a published one.", name=name),
        )
    if name not in BY_NAME:
        raise ParameterError(
            "no_such_algorithm",
            Message("There is no filter '{name}' to tune; GET /api/v1/filters lists them.", name=name),
        )
