"""Contacts of the feet as samples come, told in the push in which they are known.

The rules of core/events/foot_contact.py; they need neither heading nor the other sensors. A contact is told
at once, and again when its refined time is known; a foot-off again where its landing shows that it was none.
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


class ContactDetector:
    """Initial and terminal contacts of the feet that carry a sensor.

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
                f"Gait events need at least {pitch.min_rate_hz:g} Hz, the sensors send {rate_hz:g} Hz.",
            )
        sides = (s for f in feet for s in SIDES if FOOT[s] == f)
        self._feet = [LiveFoot(side, rate_hz, pitch, params, ways) for side in sides]
        self.sides: tuple[Side, ...] = tuple(foot.side for foot in self._feet)

    def push(
        self, q: Floats, valid: Bools, motions: Sequence[FootMovement], first: int
    ) -> list[KnownContact]:
        """Contacts that these samples make known, in the order in which they become known.

        Parameters
        ----------
        q : (T, feet, 4) foot to W. valid : (T, feet). motions : of each foot over the same samples.
        first : the chain's first sample on the axis.
        """
        found = []
        for i, foot in enumerate(self._feet):
            found += foot.push(q[:, i], valid[:, i], motions[i], first)
        return sorted(found, key=lambda x: (x.at, x.event.side))
