"""What became of a mistake: reported, repaired, harmless or silent."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal

from sagittal.core.errors import SagittalError
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.parameters.result import Parameter
from sagittal.core.pipeline import TakeAnalysis, analyse, resume
from sagittal.core.quality.stuck import mark_stuck
from validation.mistakes.kinds import IN_FILES, ON_AXIS, Mistake

Verdict = Literal["told", "repaired", "harmless", "silent"]

MOST: Final[Mapping[str, float]] = {"deg": 5.0, "s": 0.040, "pct": 5.0}
"""Unit → largest difference without a word."""
MOST_SHARE: Final = 0.05
"""The same of lengths, speeds and cadence, of the clean value."""
RELATIVE: Final = ("m", "mps", "spm")
JUDGED_BY_SHARE_FROM: Final = 0.10
"""Smaller lengths and speeds are compared with this value."""
NOT_JUDGED: Final = (
    "turn_", "walking_", "cv", "pci", "asymmetry", "regularity", "harmonic", "smoothness", "step_width",
    "clearance", "initiation", "circumduction", "toe_out", "progression", "rotation", "drift", "trunk",
    "sway",
)  # fmt: skip
"""Words in the names of parameters without an accepted limit."""


@dataclass(frozen=True)
class Outcome:
    """Verdict on one run.

    Parameters
    ----------
    codes : new warnings. worst : parameter with the largest difference over its limit; over : that ratio.
    stays : whether that parameter stays printed, beyond its own ±, although a warning was given.
    """

    verdict: Verdict
    codes: tuple[str, ...]
    worst: str
    over: float
    stays: bool


def unit_of(p: Parameter) -> str:
    """Last part of a parameter's name."""
    return p.name.rsplit("_", 1)[-1]


def measure_excess(clean: Parameter, found: Parameter) -> float:
    """Difference over its limit; 0 where it has none."""
    if clean.mean is None or found.mean is None or any(w in clean.name for w in NOT_JUDGED):
        return 0.0
    entry = CATALOGUE.get(clean.name)
    if entry is None:
        return 0.0
    unit, off = unit_of(clean), abs(found.mean - clean.mean)
    if found.estimated and found.uncertainty is not None and off <= found.uncertainty:
        # of a joint without its sensors the page prints ± 10°
        return 0.0
    if unit in RELATIVE:
        return off / (MOST_SHARE * max(abs(clean.mean), JUDGED_BY_SHARE_FROM))
    return off / MOST[unit] if unit in MOST else 0.0


def list_warnings(analysis: TakeAnalysis) -> set[tuple[str, str | None]]:
    """Codes and sensors of warnings and errors."""
    return {(n.code, n.sensor) for n in analysis.notices if n.severity != "info"}


def make(clean: TakeAnalysis, mistake: Mistake) -> TakeAnalysis | None:
    """The analysis of the recording with the mistake; None where it is refused."""
    try:
        if mistake.kind in IN_FILES:
            return analyse(IN_FILES[mistake.kind](clean.source, mistake))
        assert clean.uniform is not None
        wrong = mark_stuck(ON_AXIS[mistake.kind](clean.uniform, mistake))
        return resume(replace(clean, uniform=wrong), "agreement")
    except SagittalError:
        return None


def judge(clean: TakeAnalysis, mistake: Mistake) -> Outcome:
    """Make the mistake, analyse, and compare with the clean analysis."""
    found = make(clean, mistake)
    if found is None:
        return Outcome("told", ("refused",), "", 0.0, stays=False)
    known = {(p.name, p.side): p for p in clean.parameters}
    pairs = [(known[p.name, p.side], p) for p in found.parameters if (p.name, p.side) in known]
    worst, over, stays = "", 0.0, False
    # numbers of no walk at all, and of a walk in the wrong direction, are wrong whatever their size
    for a, b in pairs:
        x = measure_excess(a, b)
        if (
            mistake.kind == "shaken in a hand"
            and b.mean is not None
            and b.name in ("cadence_spm", "stride_time_s")
        ):
            x = 99.0
        if x > over:
            worst, over = f"{a.name} {a.side or ''}".strip(), x
            assert a.mean is not None or mistake.kind == "shaken in a hand"
            off = abs((b.mean or 0.0) - (a.mean or 0.0))
            stays = b.uncertainty is None or off > b.uncertainty
    codes = {c for c, _ in list_warnings(found) - list_warnings(clean)}
    codes |= (
        {b.reason or "" for a, b in pairs if a.mean is not None and b.mean is None} if not codes else set()
    )
    told = bool(list_warnings(found) - list_warnings(clean)) or found.problem is not None
    if over <= 1.0:
        verdict: Verdict = "repaired" if told else "harmless"
    else:
        verdict = "told" if told else "silent"
    return Outcome(verdict, tuple(sorted(codes)), worst, round(over, 2), stays=told and over > 1.0 and stays)
