"""Summary after the recording: strides with and without feedback, probe blocks, course of the level,
retention.

Cues were based on live values; the summary uses the strides of the final analysis, each with the cue that
starts at the same time. Errors return immediately without feedback (Roemmich et al. 2016), so the strides
without it show learning.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from sagittal.core.feedback.cue import Cue, Summary, WhyNot
from sagittal.core.feedback.tally import RunningStatistics
from sagittal.core.frames import SIDES, Side

TOLERANCE_S: Final = 0.1
"""A cue and a stride of the same foot that begin within this are the same stride."""

END: Final = 20
"""Training strides at the end of a visit that the next retention block is held against: its own length."""

Kind = Literal["with", "without", "baseline", "retention", "probe", "faded", "off", "stopped"]
WITHOUT: Final[tuple[Kind, ...]] = ("probe", "faded", "off", "stopped")
"""What strides without feedback are made of; off = switched off, paused or stale."""

_KINDS: Final[Mapping[WhyNot, Kind]] = {
    "baseline": "baseline",
    "retention": "retention",
    "off": "off",
    "paused": "off",
    "stale": "off",
    "stopped": "stopped",
    "probe": "probe",
    "faded": "faded",
    "positive_only": "with",
    "bandwidth": "with",
}


@dataclass(frozen=True)
class AnalysedStride:
    """A stride of the final analysis; value None if not measured."""

    side: Side
    start_s: float
    value: float | None
    counted: bool


@dataclass(frozen=True)
class MatchedStride:
    """A stride with its cue; `value` is from the analysis, `inside` relative to the zone of the cue."""

    cue: Cue
    value: float
    inside: bool


@dataclass(frozen=True)
class ProbeBlock:
    """A block without feedback, and the same number of training strides right before it."""

    number: int
    start_s: float
    probe: Summary
    before: Summary


@dataclass(frozen=True)
class LevelStep:
    """Start of a level, by stride."""

    n: int
    t_s: float
    level: int


@dataclass(frozen=True)
class FeedbackSplit:
    """Strides of the trained side after a recording.

    Parameters
    ----------
    strides : matched and counted, in order. kinds : "with", "without" and its parts, and the opening block.
        probes : in order. levels : initial one and every change. end : last training strides.
    unmatched : cues without a stride in the analysis. left_out : cues of strides not counted there.
    live_difference : mean and sd of live minus final value.
    """

    strides: tuple[MatchedStride, ...]
    kinds: Mapping[Kind, Summary]
    probes: tuple[ProbeBlock, ...]
    levels: tuple[LevelStep, ...]
    end: Summary
    unmatched: int
    left_out: int
    live_difference: Summary


def split(strides: Sequence[AnalysedStride], cues: Sequence[Cue]) -> FeedbackSplit:
    """Match every cue with its stride and summarise.

    Parameters
    ----------
    strides : of the analysis, counted or not. cues : of the recording, in order; for a stride with two cues
        the first is used.
    """
    matched: list[MatchedStride] = []
    unmatched = left_out = 0
    starts = {side: _Starts(s for s in strides if s.side == side) for side in SIDES}
    by_number = {cue.n: cue for cue in reversed(cues)}
    for cue in sorted(by_number.values(), key=lambda c: c.start_s):
        stride = starts[cue.side].take(cue.start_s)
        if stride is None:
            unmatched += 1
        elif not stride.counted or stride.value is None:
            left_out += 1
        else:
            inside = cue.zone_low <= stride.value <= cue.zone_high
            matched.append(MatchedStride(cue, stride.value, inside))
    kinds: dict[Kind, list[MatchedStride]] = {}
    for m in matched:
        kind = classify_stride(m.cue)
        kinds.setdefault(kind, []).append(m)
        if kind in WITHOUT:
            kinds.setdefault("without", []).append(m)
    difference = RunningStatistics()
    for m in matched:
        difference.add(m.cue.value - m.value, False)
    return FeedbackSplit(
        strides=tuple(matched),
        kinds={kind: summarise_strides(members) for kind, members in kinds.items()},
        probes=_probes(matched),
        levels=_levels(matched),
        end=summarise_strides([m for m in matched if classify_stride(m.cue) in {"with", "faded"}][-END:]),
        unmatched=unmatched,
        left_out=left_out,
        live_difference=difference.summary,
    )


def classify_stride(cue: Cue) -> Kind:
    """Kind of a stride."""
    return "with" if cue.with_feedback or cue.why_not is None else _KINDS[cue.why_not]


def summarise_strides(strides: Iterable[MatchedStride]) -> Summary:
    """Number, mean, sd and fraction in the zone."""
    tally = RunningStatistics()
    for m in strides:
        tally.add(m.value, m.inside)
    return tally.summary


class _Starts:
    """Strides of one side by start time, each matched at most once."""

    def __init__(self, strides: Iterable[AnalysedStride]) -> None:
        self._strides = sorted(strides, key=lambda s: s.start_s)
        self._starts = [s.start_s for s in self._strides]
        self._taken: set[int] = set()

    def take(self, start_s: float) -> AnalysedStride | None:
        first = bisect_left(self._starts, start_s - TOLERANCE_S)
        last = bisect_right(self._starts, start_s + TOLERANCE_S)
        free = [i for i in range(first, last) if i not in self._taken]
        if not free:
            return None
        nearest = min(free, key=lambda i: abs(self._starts[i] - start_s))
        self._taken.add(nearest)
        return self._strides[nearest]


def _probes(matched: Sequence[MatchedStride]) -> tuple[ProbeBlock, ...]:
    blocks: list[ProbeBlock] = []
    for number in sorted({m.cue.block for m in matched if m.cue.block is not None}):
        own = [i for i, m in enumerate(matched) if m.cue.block == number]
        preceding = [m for m in matched[: own[0]] if classify_stride(m.cue) in {"with", "faded"}][-len(own) :]
        probe = [matched[i] for i in own]
        blocks.append(
            ProbeBlock(number, probe[0].cue.start_s, summarise_strides(probe), summarise_strides(preceding))
        )
    return tuple(blocks)


def _levels(matched: Sequence[MatchedStride]) -> tuple[LevelStep, ...]:
    steps: list[LevelStep] = []
    for m in matched:
        opening = m.cue.why_not in {"baseline", "retention"}
        if not opening and (not steps or steps[-1].level != m.cue.level):
            steps.append(LevelStep(m.cue.n, m.cue.start_s, m.cue.level))
    return tuple(steps)
