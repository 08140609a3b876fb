"""Streaming contact detection, reported in the push in which contacts become known.

The rules of core/events/foot_contact.py; they need neither heading nor the other sensors. A contact is
reported at once, and again when its refined time is available; a foot-off again if its landing shows that it
was none.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from sagittal.core.errors import SignalError
from sagittal.core.events.detection import read_reports
from sagittal.core.events.foot_contact import FootContactParams, FootContactState, advance_foot_contacts
from sagittal.core.events.foot_movement import FootMovement
from sagittal.core.events.foot_pitch import FootPitchParams
from sagittal.core.events.result import GaitEvent
from sagittal.core.frames import FOOT, SIDES, Bools, Floats, Segment, Side
from sagittal.core.message import Message

REMEMBERED: Final = 4
"""Events of a foot that may be told again: a foot-off, the contact after it, and a swing that is held."""


class KnownContact(NamedTuple):
    """A contact and the sample, relative to the start of the chain, at which it is reported.

    If not `final`, its refined time is still to come; it is then reported again, with the earlier time in
    `first_s`. So is a foot-off, even if final, that the following contact shows to have been the landing.
    """

    at: int
    event: GaitEvent
    final: bool


class ContactDetector:
    """Initial and terminal contacts of the feet with a sensor.

    Raises
    ------
    SignalError `sample_rate_too_low`.
    """

    def __init__(
        self,
        feet: Sequence[Segment],
        rate_hz: float,
        pitch: FootPitchParams | None = None,
        params: FootContactParams | None = None,
    ) -> None:
        pitch = pitch or FootPitchParams()
        if rate_hz < pitch.min_rate_hz:
            raise SignalError(
                "sample_rate_too_low",
                Message(
                    "Gait events need at least {min_rate_hz:g} Hz, the sensors send {rate_hz:g} Hz.",
                    min_rate_hz=pitch.min_rate_hz,
                    rate_hz=rate_hz,
                ),
            )
        self.sides: tuple[Side, ...] = tuple(s for f in feet for s in SIDES if FOOT[s] == f)
        self._feet = [FootContactState.start(rate_hz, pitch, params) for _ in self.sides]
        self._latest: list[dict[int, GaitEvent]] = [{} for _ in self.sides]
        self._rate_hz = rate_hz

    def push(
        self, q: Floats, valid: Bools, motions: Sequence[FootMovement], first: int
    ) -> list[KnownContact]:
        """Contacts that become known with these samples, in the order of detection.

        Parameters
        ----------
        q : (T, feet, 4) foot to W. valid : (T, feet). motions : of each foot over the same samples. first :
            first sample of the chain on the axis.
        """
        found = []
        for i, (side, foot) in enumerate(zip(self.sides, self._feet, strict=True)):
            told = advance_foot_contacts(foot, q[:, i], valid[:, i], motions[i].speed, motions[i].acc)
            if not len(told.kind):
                continue
            start_s = first / self._rate_hz
            for known, final, event in read_reports(told, side, start_s, self._rate_hz, self._latest[i]):
                found.append(KnownContact(known, event, final))
            for number in list(self._latest[i])[:-REMEMBERED]:
                del self._latest[i][number]
        return sorted(found, key=lambda x: (x.at, x.event.side))
