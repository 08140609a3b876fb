"""Health findings of an estimator on its own result: diagnostics compared with limits that have a source."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from sagittal.core.frames import Bools
from sagittal.core.signals.rest import find_runs

Verdict = Literal["good", "warn", "bad"]


@dataclass(frozen=True)
class HealthFinding:
    """One diagnostic of a run.

    Parameters
    ----------
    name : with its unit at the end, e.g. "joint_residual_mm", "zero_velocity_refused_pct".
    of : the joint, segment or side it belongs to, None for the whole recording. warn, bad : upper limits of
        the next better verdict. None = displayed, not judged.
    """

    name: str
    of: str | None
    value: float
    warn: float | None = None
    bad: float | None = None

    @property
    def verdict(self) -> Verdict:
        """good, warn or bad."""
        if self.bad is not None and not self.value <= self.bad:
            return "bad"
        return "warn" if self.warn is not None and not self.value <= self.warn else "good"


def find_worst_verdict(findings: Sequence[HealthFinding]) -> Verdict:
    """The worst verdict of all."""
    verdicts = {f.verdict for f in findings}
    return "bad" if "bad" in verdicts else "warn" if "warn" in verdicts else "good"


LONGEST_MOVING_S: Final = (5.0, 20.0)
"""Time without a rest of a foot (our choice): a stride takes 1 to 2 s, an error of position grows with t² and
more from the last rest on."""


def longest_run_s(flags: Bools, rate_hz: float) -> float:
    """Duration of the longest stretch of True in flags (n,), s; 0 without any."""
    return max((stop - start for start, stop in find_runs(flags)), default=0) / rate_hz
