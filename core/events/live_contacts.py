"""Contacts of the feet as samples come, told in the push in which they are known.

The rule of core/events/foot_pitch.py; the foot's pitch needs neither heading nor the other sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from core.errors import SignalError
from core.events.detection import KINDS, SOURCE
from core.events.foot_pitch import FootPitchParams, FootPitchState, advance_foot_pitch, pitch_signal
from core.events.result import GaitEvent
from core.frames import FOOT, SIDES, Bools, Floats, Segment, Side


class KnownContact(NamedTuple):
    """A contact and the sample, counted from the start of the chain, at which it is known."""

    at: int
    event: GaitEvent


class ContactDetector:
    """Initial and terminal contacts of the feet that carry a sensor.

    Raises
    ------
    SignalError `sample_rate_too_low`.
    """

    def __init__(
        self, feet: Sequence[Segment], rate_hz: float, params: FootPitchParams | None = None
    ) -> None:
        params = params or FootPitchParams()
        if rate_hz < params.min_rate_hz:
            raise SignalError(
                "sample_rate_too_low",
                f"Gait events need at least {params.min_rate_hz:g} Hz, the sensors send {rate_hz:g} Hz.",
            )
        self.sides: tuple[Side, ...] = tuple(s for f in feet for s in SIDES if FOOT[s] == f)
        self._rules = [FootPitchState.start(rate_hz, params) for _ in self.sides]
        self._rate_hz = rate_hz

    def push(self, q: Floats, valid: Bools, first: int) -> list[KnownContact]:
        """Contacts that these samples make known, in the order in which they become known.

        Parameters
        ----------
        q : (T, feet, 4) foot to W. valid : (T, feet). first : the chain's first sample on the axis.
        """
        found = []
        for i, (side, rule) in enumerate(zip(self.sides, self._rules, strict=True)):
            told = advance_foot_pitch(rule, pitch_signal(q[:, i]), valid[:, i])
            for kind, index, known, offset in zip(*told, strict=True):
                event = GaitEvent(
                    time_s=(first + int(index) + float(offset)) / self._rate_hz,
                    side=side,
                    kind=KINDS[kind],
                    source=SOURCE,
                    detected_s=(first + int(known)) / self._rate_hz,
                )
                found.append(KnownContact(int(known), event))
        return sorted(found, key=lambda x: (x.at, x.event.side))
