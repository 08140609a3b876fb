"""Prior data about a person for the start level and the guard."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

from sagittal.core.feedback.fields import RecordFields
from sagittal.core.feedback.prescription import LEVELS


@dataclass(frozen=True)
class Baseline:
    """Data about the person from earlier sessions.

    Parameters
    ----------
    mean, sd, n : of the parameter on the trained side in an earlier session; None without one.
    session_id : that session.
    last_level : final level of the last training with the same prescription; None without one.
    other_mdc, other_mdc_source : limit of change of the other side, None without a source.
    after_training : an earlier visit trained the same parameter, so this one begins with a retention block.
    """

    mean: float | None = None
    sd: float | None = None
    n: int = 0
    session_id: str | None = None
    last_level: int | None = None
    other_mdc: float | None = None
    other_mdc_source: str | None = None
    after_training: bool = False

    def to_json(self) -> dict[str, object]:
        """Plain values; `from_json` reads them back."""
        return asdict(self)

    @staticmethod
    def from_json(data: Mapping[str, object]) -> Baseline:
        """Parse the output of `to_json`; raises ParameterError bad_prescription."""
        f = RecordFields("baseline", data)
        baseline = Baseline(
            f.number_or_none("mean", None),
            f.number_or_none("sd", None, 0.0),
            f.whole("n", 0, 0, 10**9),
            f.text("session_id", None),
            f.whole_or_none("last_level", None, 0, LEVELS),
            f.number_or_none("other_mdc", None, 0.0),
            f.text("other_mdc_source", None),
            f.flag("after_training", False),
        )
        f.refuse_unknown()
        return baseline
