"""Placement of text in printed cycle charts, where it has no light outline: clear of the curves."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple
from xml.etree.ElementTree import Element

SVG: Final = "{http://www.w3.org/2000/svg}"

CURVES: Final = frozenset({"ml", "mr", "pvl", "pvr"})
UPRIGHTS: Final = frozenset({"fol", "for"})
"""Classes of elements that a label must not cover: means of both sides and of the previous visit, and
foot-off marks.
"""

LETTER_PX: Final = 5.5
"""Mean letter width at 11 px, slightly more than that of the widest font."""
ABOVE_PX, BELOW_PX, ROOM_PX = 8.5, 2.5, 1.5
"""Extent of a line of text above and below its baseline, and free space around it."""
STEP_PX: Final = 2
OUTWARDS_PX: Final = {True: (0, -3), False: (0, 3, 6)}
"""Maximum shift of the upper and lower label from their usual line towards and across the edge."""
ABOVE_PLOT: Final = -5
"""Baseline of text above the plot, in px: foot-off labels."""

_STEP: Final = re.compile(r"([MlL])|(-?\d+\.?\d*)\s+(-?\d+\.?\d*)")

Box = tuple[float, float, float, float]
"""Left, top, right, bottom in px."""


def place_words(figure: Element, width: float, height: float, left: float) -> None:
    """Move the labels of a chart along its upper or lower edge to the place with least overlap.

    The upper label is moved above the plot if no place inside is clear and the foot-off marks leave space.

    Parameters
    ----------
    figure : chart of fixed size, px. width, height : of its plot area. left : margin.
    """
    curves = [
        p for part in figure.iter(f"{SVG}path") if _is_of(part, CURVES) for p in _sample(part.get("d", ""))
    ]
    uprights = [float(e.get("x1", "0")) for e in figure.iter(f"{SVG}line") if _is_of(e, UPRIGHTS)]
    label_boxes = [_box_of(t) for t in figure.iter(f"{SVG}text") if _is_of(t, {"tl", "tr"})]
    for word in figure.iter(f"{SVG}text"):
        if not _is_of(word, {"words"}) or word.get("text-anchor") != "start":
            continue
        first = _box_of(word)
        is_upper = first[3] < height / 2
        best = _find_place(first, width, OUTWARDS_PX[is_upper], curves, uprights)
        box_above = (-left, ABOVE_PLOT - ABOVE_PX, first[2] - first[0] - left, ABOVE_PLOT + BELOW_PX)
        if is_upper and best.touched and not any(_overlap(box_above, label_box) for label_box in label_boxes):
            best = _Place(0, -left, ABOVE_PLOT)
        word.set("x", f"{best.x:g}")
        word.set("y", f"{best.base:g}")
        word.set("dx", "0")
        word.set("dy", "0")


class _Place(NamedTuple):
    """Candidate position of a line of text, px, and the length of lines it would cover, px."""

    touched: int
    x: float
    base: float


def _find_place(
    first: Box,
    width: float,
    outwards: Sequence[int],
    curves: Sequence[tuple[float, float]],
    uprights: Sequence[float],
) -> _Place:
    """The place with least overlap; among equal ones the innermost, then the leftmost."""
    long, begin = first[2] - first[0], round(first[0])
    places = range(begin, max(int(width - long), begin) + 1, STEP_PX)
    best: _Place | None = None
    for out in outwards:
        for x in places:
            box = x, first[1] + out, x + long, first[3] + out
            touched = _count_touches(box, curves, uprights)
            if best is None or touched < best.touched:
                best = _Place(touched, x, first[3] - BELOW_PX + out)
            if not touched:
                return best
    assert best is not None  # noqa: S101 - both have at least one
    return best


def _count_touches(box: Box, curves: Sequence[tuple[float, float]], uprights: Sequence[float]) -> int:
    """Length in px of curves within a box; a vertical line counts with the full height of the box."""
    low, top, high, bottom = box[0] - ROOM_PX, box[1] - ROOM_PX, box[2] + ROOM_PX, box[3] + ROOM_PX
    return sum(low <= x <= high and top <= y <= bottom for x, y in curves) + sum(
        round(bottom - top) for x in uprights if low <= x <= high
    )


def _overlap(a: Box, b: Box) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _box_of(text: Element) -> Box:
    long = LETTER_PX * len("".join(text.itertext()))
    x = float(text.get("x", "0")) + float(text.get("dx", "0"))
    base = float(text.get("y", "0")) + float(text.get("dy", "0"))
    x -= {"middle": long / 2, "end": long}.get(text.get("text-anchor", ""), 0.0)
    return x, base - ABOVE_PX, x + long, base + BELOW_PX


def _sample(path: str) -> Iterator[tuple[float, float]]:
    """Points about one px apart on a path of M, L and l, as written by `paper_charts.stretch_path`."""
    command, x, y = "M", 0.0, 0.0
    for letter, dx, down in _STEP.findall(path):
        if letter:
            command = letter
            continue
        ends = (x + float(dx), y + float(down)) if command == "l" else (float(dx), float(down))
        steps = 1 if command == "M" else max(1, round(max(abs(ends[0] - x), abs(ends[1] - y))))
        for k in range(1, steps + 1):
            yield x + (ends[0] - x) * k / steps, y + (ends[1] - y) * k / steps
        x, y = ends


def _is_of(shape: Element, classes: frozenset[str] | set[str]) -> bool:
    return not classes.isdisjoint(shape.get("class", "").split())
