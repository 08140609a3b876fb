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
    """A contact and the sample, counted from the start of the chain, at which it is told.

    Not `final`: its refined time is still to come. Then it is told again, its `first_s` the time it had. So
    is a foot-off, though final, that the contact after it shows to have been the landing.
    """

    at: int
    event: GaitEvent
    final: bool


class LiveFoot:
    """One foot; any division of its samples into blocks tells the same.

    Both finders run. A file chooses between them for a whole take (choice.py), a stream by the last swings:
    where their contacts by way have none by pitch beside them, those are told from then on, the last
    `JUDGED` in arrears. What the pitch told before stays told.
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
        told = [
            (known, 0, final, event)
            for known, final, event in read_reports(pitch, self.side, start_s, self._rate_hz, self._latest)
        ]
        told += [
            (known, 1, final, event)
            for known, final, event in read_reports(way, self.side, start_s, self._rate_hz, self._by_way)
        ]
        found: list[KnownContact] = []
        for known, by_way, final, event in sorted(told, key=lambda x: x[:2]):
            if by_way:
                found += self._take_way(known, event)
            else:
                found += self._take_pitch(known, final, event)
        for kept in (self._latest, self._by_way):
            for number in list(kept)[:-REMEMBERED]:
                del kept[number]
        return found

    def _take_pitch(self, known: int, final: bool, event: GaitEvent) -> list[KnownContact]:
        if event.kind == "ic":
            self._landed[event.time_s if event.first_s is None else event.first_s] = event.time_s
            for moment in list(self._landed)[: -2 * JUDGED]:
                del self._landed[moment]
        return [] if self._believed else [KnownContact(known, event, final)]

    def _take_way(self, known: int, event: GaitEvent) -> list[KnownContact]:
        """A foot-off and the contact after it come together, the foot-off first."""
        if event.kind == "tc":
            self._leaving = event
            return []
        self._swings = [*self._swings, (self._leaving, event)][-JUDGED:]
        self._untold = min(self._untold + 1, JUDGED)
        landings = [on.time_s for _, on in self._swings]
        since = landings[0] - 0.5 * (landings[-1] - landings[0]) / max(1, len(landings) - 1)
        beside = [t for t in self._landed.values() if since <= t <= landings[-1] + 0.5]
        believed = believes_way([(off.time_s, on.time_s) for off, on in self._swings], beside)
        if not believed and len(landings) < LEAST:
            return []
        self._believed = believed
        if not believed:
            self._untold = 0 if len(landings) == JUDGED else self._untold
            return []
        late = self._swings[len(self._swings) - self._untold :]
        self._untold = 0
        return [
            KnownContact(known, x, True)
            for off, on in late
            if not count_seen([on.time_s], beside)
            for x in (off, on)
        ]
