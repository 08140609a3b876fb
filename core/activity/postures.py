"""Posture classification between certain stretches (docs/science/activity.md, "Postures").

Lying, walking and transitions are certain. A stretch between two of them is sitting or standing, as implied
by both ends: standing after rising, before sitting down, and before and after walking; sitting next to lying.
If the two ends contradict each other, a candidate transition that only lacks lean amplitude may resolve the
conflict; otherwise the posture is unknown, and a transition from the wrong posture is marked inconsistent.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from types import MappingProxyType
from typing import Final, Literal

from sagittal.core.activity.result import (
    ActivityKind,
    ActivitySpan,
    Evidence,
    PosturalTransition,
    TransitionCandidate,
    TransitionKind,
)
from sagittal.core.signals.rest import Window

Upright = Literal["sitting", "standing"]

AFTER: Final[Mapping[TransitionKind, Upright]] = MappingProxyType(
    {"sit_to_stand": "standing", "stand_to_sit": "sitting"}
)
BEFORE: Final[Mapping[TransitionKind, Upright]] = MappingProxyType(
    {"sit_to_stand": "sitting", "stand_to_sit": "standing"}
)
BESIDE: Final[Mapping[ActivityKind, Upright | None]] = MappingProxyType(
    {"lying": "sitting", "walking": "standing", "stairs_up": "standing", "stairs_down": "standing"}
)
"""What somebody did before and after lying (thesis 7.2.4) and walking."""

CONFIDENCE: Final[Mapping[Evidence, float]] = MappingProxyType(
    {"both_ends": 1.0, "steps": 1.0, "inclination": 0.8, "one_end": 0.7, "sub_threshold": 0.5}
)


@dataclass(frozen=True)
class FixedStretch:
    """A stretch with a certain activity."""

    start_s: float
    end_s: float
    kind: ActivityKind
    evidence: Evidence


def decide_postures(
    duration_s: float,
    fixed: Sequence[FixedStretch],
    tilted: Sequence[Window],
    transitions: Sequence[PosturalTransition],
    candidates: Sequence[TransitionCandidate],
    longest_stand_s: float,
) -> tuple[tuple[ActivitySpan, ...], tuple[PosturalTransition, ...]]:
    """Divide the time from 0 to `duration_s` into spans, and check the transitions for consistency.

    Parameters
    ----------
    fixed : in chronological order, not overlapping. tilted : inclined past the lying limit without being
    still.
    candidates : only those rejected for too small a lean or for being close to lying are used.
    """
    spans: list[ActivitySpan] = []
    checked: list[PosturalTransition] = []
    upright = [t for t in transitions if t.kind in AFTER]
    times = [t.time_s for t in upright]
    settling = [c for c in candidates if c.refused in ("lean_below_limit", "near_lying")]
    edges: list[FixedStretch | None] = [None, *fixed, None]
    for left, right in pairwise(edges):
        start = 0.0 if left is None else left.end_s
        end = duration_s if right is None else right.start_s
        if left is not None:
            spans.append(_span(left.start_s, left.end_s, left.kind, left.evidence))
        inside = upright[bisect_left(times, start) : bisect_right(times, end)] if end > start else []
        spans += _fill(start, end, left, right, inside, settling, longest_stand_s, checked)
    lying = [t for t in transitions if t.kind not in AFTER]
    all_transitions = tuple(sorted((*checked, *lying), key=lambda t: t.time_s))
    return tuple(_merge(_overlay(spans, tilted))), all_transitions


def _fill(
    start: float,
    end: float,
    left: FixedStretch | None,
    right: FixedStretch | None,
    inside: Sequence[PosturalTransition],
    settling: Sequence[TransitionCandidate],
    longest_stand_s: float,
    checked: list[PosturalTransition],
) -> list[ActivitySpan]:
    """Spans between two certain stretches, given the transitions in between, which are appended to
    `checked`.
    """
    if end <= start:
        checked += inside
        return []
    spans: list[ActivitySpan] = []
    marks = [start, *(t.time_s for t in inside), end]
    for k, (a, b) in enumerate(pairwise(marks)):
        first = _beside(left) if k == 0 else AFTER[inside[k - 1].kind]
        last = _beside(right) if k == len(inside) else BEFORE[inside[k].kind]
        consistent = True
        if first is None or last is None:
            kind = first or last
            if kind is None:
                spans.append(_span(a, b, "unknown", "nothing_known"))
            else:
                spans.append(_stand(a, b, kind, "one_end", longest_stand_s))
        elif first == last:
            spans.append(_stand(a, b, first, "both_ends", longest_stand_s))
        else:
            expected = "sit_to_stand" if last == "standing" else "stand_to_sit"
            matching = [c for c in settling if a < c.time_s < b and c.likely == expected]
            if matching:
                t = max(matching, key=lambda c: abs(c.rise_m)).time_s
                spans.append(_stand(a, t, first, "sub_threshold", longest_stand_s))
                spans.append(_stand(t, b, last, "sub_threshold", longest_stand_s))
            else:
                consistent = False
                spans.append(_span(a, b, "unknown", "contradiction"))
        if k < len(inside):
            checked.append(inside[k] if consistent else replace(inside[k], consistent=False))
    return [s for s in spans if s.end_s > s.start_s]


def _beside(stretch: FixedStretch | None) -> Upright | None:
    return None if stretch is None else BESIDE.get(stretch.kind)


def _stand(a: float, b: float, kind: Upright, evidence: Evidence, longest_s: float) -> ActivitySpan:
    """Sitting or standing; standing for too long without a step becomes unknown."""
    if kind == "standing" and b - a > longest_s:
        return _span(a, b, "unknown", "too_long_still")
    return _span(a, b, kind, evidence)


def _span(a: float, b: float, kind: ActivityKind, evidence: Evidence) -> ActivitySpan:
    return ActivitySpan(a, b, kind, CONFIDENCE.get(evidence), evidence)


def _overlay(spans: Sequence[ActivitySpan], tilted: Sequence[Window]) -> list[ActivitySpan]:
    """Spans with brief inclinations past the lying limit replaced by unknown."""
    out: list[ActivitySpan] = []
    ends = [w[1] for w in tilted]
    for span in spans:
        cursor_s = span.start_s
        if span.kind in ("sitting", "standing", "walking"):
            for w in tilted[bisect_right(ends, span.start_s) :]:
                if w[0] >= span.end_s:
                    break
                a, b = max(cursor_s, w[0]), min(span.end_s, w[1])
                if a > cursor_s:
                    out.append(replace(span, start_s=cursor_s, end_s=a))
                out.append(_span(a, b, "unknown", "brief_tilt"))
                cursor_s = b
        if span.end_s > cursor_s:
            out.append(replace(span, start_s=cursor_s))
    return out


def _merge(spans: Sequence[ActivitySpan]) -> list[ActivitySpan]:
    """Merge adjacent spans of equal kind."""
    merged: list[ActivitySpan] = []
    for span in spans:
        last = merged[-1] if merged else None
        if last is not None and (last.kind, last.evidence) == (span.kind, span.evidence):
            merged[-1] = replace(last, end_s=span.end_s)
        else:
            merged.append(span)
    return merged
