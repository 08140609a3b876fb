"""Streaming contact detection, reported in the push in which contacts become known.

The rules of core/events/foot_contact.py; they need neither heading nor the other sensors. A contact is
reported at once, and again when its refined time is available; a foot-off again if its landing shows that it
was none.
"""

from __future__ import annotations

from collections.abc import Sequence

from sagittal.core.errors import SignalError
from sagittal.core.events.foot_contact import FootContactParams
from sagittal.core.events.foot_movement import FootMovement
from sagittal.core.events.foot_pitch import FootPitchParams
from sagittal.core.events.foot_way import FootWayParams
from sagittal.core.events.live_foot import KnownContact, LiveFoot
from sagittal.core.frames import FOOT, SIDES, Bools, Floats, Segment, Side
from sagittal.core.message import Message


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
        ways: FootWayParams | None = None,
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
        sides = (s for f in feet for s in SIDES if FOOT[s] == f)
        self._feet = [LiveFoot(side, rate_hz, pitch, params, ways) for side in sides]
        self.sides: tuple[Side, ...] = tuple(foot.side for foot in self._feet)

    def push(
        self, q: Floats, valid: Bools, motions: Sequence[FootMovement], first: int
    ) -> list[KnownContact]:
        """Contacts that become known with these samples, in the order of detection.

        Parameters
        ----------
        q : (T, feet, 4) foot to W. valid : (T, feet). motions : of each foot over the same samples. first :
            first sample of the chain on the axis.
        """
        contacts = []
        for i, foot in enumerate(self._feet):
            contacts += foot.push(q[:, i], valid[:, i], motions[i], first)
        return sorted(contacts, key=lambda x: (x.at, x.event.side))
