"""Consistency checks of every sensor's clock and placement in words, including those not possible."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from sagittal.core.message import Message
from sagittal.server.report.words.wording import format_number, place_words

NOT_JUDGED: Final = "cannot be assessed"


@dataclass(frozen=True)
class SensorCheck:
    """One sensor: words for its clock and placement, with a kind (ok, warn, or none if not checked)."""

    sensor: str
    clock: str
    clock_kind: str
    place: str
    place_kind: str


@dataclass(frozen=True)
class SensorChecks:
    """All sensors of a trial.

    Parameters
    ----------
    exchanged : pairs of swapped sensors, in words; empty if none. notes : supplementary sentences.
    """

    rows: tuple[SensorCheck, ...]
    exchanged: str
    notes: tuple[str, ...]


def sensor_checks(checks: Mapping[str, Any] | None) -> SensorChecks | None:
    """View of `agreement` in analysis.json; None for older versions or a single sensor."""
    if checks is None or len(checks["sensors"]) < 2:
        return None
    rows = tuple(_row(s) for s in checks["sensors"])
    pairs = [
        Message("{value} and {value2}", value=place_words(a), value2=place_words(b))
        for a, b in checks["exchanged"]
    ]
    unclear = [s for s in checks["sensors"] if s.get("place_judged_s") is None]
    notes = []
    if any(s["sensor"] == "pelvis" for s in unclear):
        notes.append(
            "A slip of the pelvis sensor cannot be detected, because hip angles vary by ± 10° in walking "
            "anyway. Interpret hip angles with care if the belt was loose."
        )
    if any(s["sensor"] != "pelvis" for s in unclear):
        notes.append(
            "A sensor is reported as stable only if a slip would have been detectable during most of the "
            "walk. Stand still before and after the walk, or walk for longer."
        )
    if not all(s["clock_judged"] for s in checks["sensors"]):
        notes.append(
            "A clock can be checked in walking if an adjacent segment across the hip, knee or ankle has "
            "a sensor."
        )
    if len(unclear) < len(checks["sensors"]):
        notes.append("Slowly loosening straps and a second slip of the same sensor are not detected.")
    return SensorChecks(rows, "; ".join(pairs), tuple(notes))


def _row(s: Mapping[str, Any]) -> SensorCheck:
    return SensorCheck(place_words(str(s["sensor"])).capitalize(), *_clock(s), *_place(s))


def _clock(s: Mapping[str, Any]) -> tuple[str, str]:
    done = "corrected" if s["shifted"] else "not corrected"
    if s["drift_ms"] is not None:
        which = "slow" if s["drift_ms"] > 0 else "fast"
        return (
            Message(
                "Clock runs {which}, {format_number}\u202fms over the trial, {done}",
                which=which,
                format_number=format_number(abs(s["drift_ms"])),
                done=done,
            ),
            "warn",
        )
    if s["lag_ms"] is not None:
        which = "late" if s["lag_ms"] > 0 else "early"
        return Message(
            "Clock {format_number}\u202fms {which}, {done}",
            format_number=format_number(abs(s["lag_ms"])),
            which=which,
            done=done,
        ), "warn"
    if s.get("clock_doubted"):
        return "Clock appears wrong, see notices", "warn"
    return (
        ("Clock agrees", "ok")
        if s["clock_judged"]
        else (Message("Clock {NOT_JUDGED}", NOT_JUDGED=NOT_JUDGED), "")
    )


def _place(s: Mapping[str, Any]) -> tuple[str, str]:
    if s["slip_deg"] is not None:
        return (
            Message(
                "Slipped {format_number}° about {format_number2}\u202fs",
                format_number=format_number(abs(s["slip_deg"])),
                format_number2=format_number(s["slip_at_s"]),
            ),
            "warn",
        )
    # older versions did not store the period of the check
    if (duration_s := s.get("place_judged_s")) is None:
        return Message("Placement {NOT_JUDGED}", NOT_JUDGED=NOT_JUDGED), ""
    start, end = (format_number(x) for x in duration_s)
    return Message("Stable from {start} to {end}\u202fs", start=start, end=end), "ok"
