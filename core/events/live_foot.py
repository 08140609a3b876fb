"""Contacts of one streamed foot: by pitch, and by the way it moves where its pitch misreads it."""

from __future__ import annotations

from typing import Final, NamedTuple

from sagittal.core.events.choice import LEAST, believes_way, count_seen
from sagittal.core.events.detection import read_reports
from sagittal.core.events.foot_contact import FootContactParams, FootContactState, advance_foot_contacts
from sagittal.core.events.foot_movement import FootMovement
from sagittal.core.events.foot_pitch import FootPitchParams
from sagittal.core.events.foot_way import FootWayParams, FootWayState, advance_foot_ways
from sagittal.core.events.result import GaitEvent
from sagittal.core.frames import Bools, Floats, Side

REMEMBERED: Final = 4
"""Events of a foot that may be told again: a foot-off, the contact after it, and a swing that is held."""
JUDGED: Final = 5
"""So many of the last swings by way say whether the foot's pitch is to be believed."""


class KnownContact(NamedTuple):
    """A contact and the sample, counted from the start of the chain, at which it is reported.

    Not `final`: a refined time follows. The contact is then reported again, with its first time as `first_s`.
    A final foot-off is also reported again if the following contact shows that it was the landing.
    """

    at: int
    event: GaitEvent
    final: bool


class LiveFoot:
    """Contacts of one streamed foot, independent of the division of its samples into blocks.

    Both detectors run. A file chooses between them for a whole trial (choice.py), a stream by the last
    swings: if their contacts by displacement have no contacts by pitch close in time, the former are
    reported from then on, including those of the last `JUDGED` swings. Contacts by pitch reported earlier are
    not withdrawn.
    """

    def __init__(
        self,
        side: Side,
        rate_hz: float,
        pitch: FootPitchParams,
        params: FootContactParams | None,
        ways: FootWayParams | None = None,
    ) -> None:
        self.side = side
        self._rate_hz = rate_hz
        self._pitch = FootContactState.start(rate_hz, pitch, params)
        self._way = FootWayState.start(rate_hz, ways)
        self._latest: dict[int, GaitEvent] = {}
        self._by_way: dict[int, GaitEvent] = {}
        self._swings: list[tuple[GaitEvent, GaitEvent]] = []
        self._untold = 0
        self._landed: dict[float, float] = {}
        self._believed = False

    def push(self, q: Floats, valid: Bools, motion: FootMovement, first: int) -> list[KnownContact]:
        """Contacts that these samples make known, in the order in which they become known.

        Parameters
        ----------
        q : (T, 4) foot to W. valid : (T,). first : the chain's first sample on the axis.
        """
        start_s = first / self._rate_hz
        pitch = advance_foot_contacts(self._pitch, q, valid, motion.speed, motion.acc)
        way = advance_foot_ways(self._way, q, valid, motion.acc)
        # the contact by pitch of the same sample is known before that by way
        reports = [
            (detection, 0, final, event)
            for detection, final, event in read_reports(
                pitch, self.side, start_s, self._rate_hz, self._latest
            )
        ]
        reports += [
            (detection, 1, final, event)
            for detection, final, event in read_reports(way, self.side, start_s, self._rate_hz, self._by_way)
        ]
        contacts: list[KnownContact] = []
        for detection, by_way, final, event in sorted(reports, key=lambda x: x[:2]):
            if by_way:
                contacts += self._take_way(detection, event)
            else:
                contacts += self._take_pitch(detection, final, event)
        for store in (self._latest, self._by_way):
            for number in list(store)[:-REMEMBERED]:
                del store[number]
        return contacts

    def _take_pitch(self, detection: int, final: bool, event: GaitEvent) -> list[KnownContact]:
        if event.kind == "ic":
            self._landed[event.time_s if event.first_s is None else event.first_s] = event.time_s
            for moment in list(self._landed)[: -2 * JUDGED]:
                del self._landed[moment]
        return [] if self._believed else [KnownContact(detection, event, final)]

    def _take_way(self, detection: int, event: GaitEvent) -> list[KnownContact]:
        """A foot-off and the contact after it come together, the foot-off first."""
        if event.kind == "tc":
            self._leaving = event
            return []
        self._swings = [*self._swings, (self._leaving, event)][-JUDGED:]
        self._untold = min(self._untold + 1, JUDGED)
        landings = [on.time_s for _, on in self._swings]
        since = landings[0] - 0.5 * (landings[-1] - landings[0]) / max(1, len(landings) - 1)
        pitch_contacts = [t for t in self._landed.values() if since <= t <= landings[-1] + 0.5]
        believed = believes_way([(off.time_s, on.time_s) for off, on in self._swings], pitch_contacts)
        if not believed and len(landings) < LEAST:
            return []
        self._believed = believed
        if not believed:
            self._untold = 0 if len(landings) == JUDGED else self._untold
            return []
        late = self._swings[len(self._swings) - self._untold :]
        self._untold = 0
        return [
            KnownContact(detection, x, True)
            for off, on in late
            if not count_seen([on.time_s], pitch_contacts)
            for x in (off, on)
        ]
