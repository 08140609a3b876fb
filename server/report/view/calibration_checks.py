"""View of a calibration score: overall result in one sentence, then all sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from sagittal.core.errors import Notice
from sagittal.core.frames import SEGMENTS
from sagittal.core.message import Message
from sagittal.core.plurals import plural
from sagittal.server.report.view.quality_box import CALIBRATION_METHODS
from sagittal.server.report.words.wording import format_number, place_words, speak_places

VERDICT_WORDS: Final[Mapping[str, tuple[str, str]]] = {
    "pass": ("ok", "pass"),
    "redo": ("bad", "redo"),
    "not_judged": ("none", "not assessed"),
}
"""Verdict → symbol and word."""

WHOLE: Final = "take"
"""Stands for checks of no single sensor."""


@dataclass(frozen=True)
class CheckRow:
    """One check: value and limit as text, symbol and word of the result, reason, and remedy."""

    title: str
    value: str
    limit: str
    kind: str
    word: str
    why: str
    todo: str


@dataclass(frozen=True)
class CheckedSegment:
    """One sensor, or the whole trial.

    Parameters
    ----------
    id : segment, or `WHOLE`. method : method for its forward axis, empty if undetermined.
    sigma : uncertainty of that axis as text; empty if unknown.
    told : warnings about this sensor, such as a slip after calibration.
    """

    id: str
    title: str
    kind: str
    word: str
    method: str
    sigma: str
    rows: tuple[CheckRow, ...]
    told: tuple[str, ...] = ()


@dataclass(frozen=True)
class CalibrationChecks:
    """View of the page: overall `kind` and `headline`, sensors from the trunk downwards."""

    kind: str
    headline: str
    segments: tuple[CheckedSegment, ...]

    @property
    def of_segment(self) -> Mapping[str, CheckedSegment]:
        """Segment → its checks, for the diagram."""
        return {s.id: s for s in self.segments}


def view_calibration_checks(
    score: Mapping[str, Any] | None, calibration: Mapping[str, Any] | None, warnings: Sequence[Notice]
) -> CalibrationChecks | None:
    """View of `calibration_score`, `calibration` and notices of analysis.json; None without a score."""
    if score is None:
        return None
    notices_by_sensor: dict[str | None, list[str]] = {}
    for notice in warnings:
        if notice.severity != "info":
            notices_by_sensor.setdefault(notice.sensor, []).append(speak_places(notice.message))
    checks: Sequence[Mapping[str, Any]] = score["checks"]
    present = [s for s in SEGMENTS if s in score["segments"]]
    mounted = {} if calibration is None else calibration["segments"]
    whole = [c for c in checks if c["segment"] is None]
    segments = [_view_segment(s, score["segments"][s], checks, mounted.get(s, {})) for s in present]
    segments = [replace(s, told=tuple(notices_by_sensor.get(s.id, ()))) for s in segments]
    if whole:
        kinds = {c["verdict"] for c in whole}
        verdict = next((v for v in ("redo", "pass") if v in kinds), "not_judged")
        kind, word = VERDICT_WORDS[verdict]
        rows = tuple(_view_check(c) for c in whole)
        segments.insert(0, CheckedSegment(WHOLE, "Whole trial", kind, word, "", "", rows))
    return CalibrationChecks(
        VERDICT_WORDS[score["verdict"]][0], say_verdict(score["verdict"], checks), tuple(segments)
    )


def say_verdict(verdict: str, checks: Sequence[Mapping[str, Any]]) -> str:
    """Overall result in one sentence."""
    checked = [c for c in checks if c["verdict"] != "not_judged"]
    if verdict == "pass":
        return plural(
            len(checked),
            "Calibration: the one applicable check passed.",
            Message("Calibration: all {checked} checks passed.", checked=len(checked)),
        )
    if verdict == "not_judged":
        return "The calibration of this trial cannot be checked."
    failed = [c for c in checks if c["verdict"] == "redo"]
    places = list(dict.fromkeys(place_words(c["segment"]) if c["segment"] else "walk" for c in failed))
    shortened = places if len(places) <= 3 else [*places[:2], Message("{len} more", len=len(places) - 2)]
    listed = " and ".join(filter(None, (", ".join(shortened[:-1]), shortened[-1])))
    which = plural(len(failed), "checks fails", "checks fail")
    return Message(
        "Calibrate again: {failed} of {checked} {which}, at the {listed}.",
        failed=len(failed),
        checked=len(checked),
        which=which,
        listed=listed,
    )


def _view_segment(
    segment: str, verdict: str, checks: Sequence[Mapping[str, Any]], mounted: Mapping[str, Any]
) -> CheckedSegment:
    kind, word = VERDICT_WORDS[verdict]
    method = str(mounted.get("method", ""))
    sigma = mounted.get("forward_sd_deg")
    return CheckedSegment(
        id=segment,
        title=place_words(segment).capitalize(),
        kind=kind,
        word=word,
        method=CALIBRATION_METHODS.get(method, method.replace("_", " ")),
        sigma=f"± {format_number(sigma, 1)}°" if isinstance(sigma, int | float) else "",
        rows=tuple(_view_check(c) for c in checks if c["segment"] == segment),
    )


def _view_check(check: Mapping[str, Any]) -> CheckRow:
    kind, word = VERDICT_WORDS[check["verdict"]]
    limit = check["limit"]
    bound = {"least": "at least", "most": "at most"}[check["limit_is"]]
    return CheckRow(
        title=check["title"],
        value="–" if check["value"] is None else _write(check["value"], check["unit"]),
        limit="" if limit is None else f"{bound} {_write(limit, check['unit'])}",
        kind=kind,
        word=word,
        why=check["why"],
        todo=check["todo"],
    )


def _write(value: float, unit: str) -> str:
    """A value with its unit: degrees and percent to one decimal, fractions to two, counts as integers."""
    if unit:
        return f"{format_number(value, 1)}{'' if unit == '°' else chr(0x202F)}{unit}"
    return format_number(value, 0 if value == round(value) and value > 1 else 2)
