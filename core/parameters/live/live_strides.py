"""Contacts → live strides: each reported when its second contact is known, again when that contact is
refined, and again when its distances are known.

In the stride list of a whole recording the neighbours of a stride determine whether it is counted; here only
the earlier ones are available, so it is unknown whether a stride is the last. It is reported as counted, and
reported again as not counted if no further step follows, or if its distances show that it was in place.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, floor
from typing import Final

import numpy as np

from sagittal.core.angles import JointAngles, compute_headings
from sagittal.core.body.feet import FootTracks
from sagittal.core.body.model import BodyModel
from sagittal.core.events.flags import StrideParams, add_flag, find_flags
from sagittal.core.events.live_foot import KnownContact
from sagittal.core.events.result import GaitEvent, GaitEvents, Stride, StrideFlag
from sagittal.core.events.strides import NEAR_S, side_strides
from sagittal.core.frames import FOOT, Floats, Segment, Side
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.parameters.flats import OTHER
from sagittal.core.parameters.live.live_figures import StrideSpan, early_figures, late_figures
from sagittal.core.parameters.live.live_history import KEPT_S, SampleHistory
from sagittal.core.parameters.live.live_stride import LiveStride
from sagittal.core.parameters.rows import Value
from sagittal.core.parameters.spatial import NAMES as SPATIAL
from sagittal.core.parameters.spatial import Surface

REMEMBERED: Final = 20
"""Strides of a foot that the next one is compared with: those of the therapist's strip."""

LATER: Final[frozenset[StrideFlag]] = frozenset(("last", "non_periodic"))
"""Flags that only a later stride, or none, can give; the neighbours before a stride must not."""


@dataclass(frozen=True)
class HistoryColumns:
    """Layout of the columns of the history.

    Parameters
    ----------
    first : sample 0 on the axis. angles : names of the angle columns. courses : pelvis and feet with a
        sensor. feet : sides with a stored path.
    """

    first: int
    rate_hz: float
    angles: tuple[str, ...]
    courses: tuple[Segment, ...]
    feet: tuple[Side, ...]
    linked: bool
    source: str
    body: BodyModel
    surface: Surface


@dataclass
class _Pending:
    """A stride with pending distances, and the sample at which they are given up."""

    told: LiveStride
    stride: Stride
    until: int


class LiveStrides:
    """The strides of a live recording, in the order in which they become known."""

    def __init__(self, setup: HistoryColumns, params: StrideParams | None = None) -> None:
        self._setup, self._params = setup, params or StrideParams()
        self._events: deque[GaitEvent] = deque()
        self._recent: dict[Side, deque[Stride]] = {s: deque(maxlen=REMEMBERED) for s in OTHER}
        self._pending: list[_Pending] = []
        self._last: dict[Side, int] = {}
        self._count = 0
        self._near = ceil(NEAR_S * setup.rate_hz) + 1

    def push(self, contacts: Iterable[KnownContact], history: SampleHistory) -> list[LiveStride]:
        """Strides completed by the contacts since the last call, or by the time elapsed."""
        strides: list[LiveStride] = []
        for sample, event, final in contacts:
            strides += self._given_up(sample, history)
            if event.first_s is not None:
                strides += self._refined(sample, event, history)
                continue
            self._events.append(event)
            # as far back as the samples go
            while event.detected_s - self._events[0].time_s > KEPT_S + self._params.max_s:
                self._events.popleft()
            strides += self._completed(sample, history)
            if event.kind == "ic":
                strides += self._landed(sample, event, history, final)
        return strides + self._given_up(history.length - 1, history)

    def _refined(self, sample: int, event: GaitEvent, history: SampleHistory) -> list[LiveStride]:
        """The stride ended by this contact, with its refined end."""
        for i, e in enumerate(self._events):
            if (e.side, e.kind, e.time_s) == (event.side, event.kind, event.first_s):
                self._events[i] = event
        recent = self._recent[event.side]
        if not recent or recent[-1].end_s != event.first_s:
            return []
        recent.pop()
        number = self._last.pop(event.side)
        self._pending = [p for p in self._pending if p.told.n != number]
        return self._landed(sample, event, history, True, number)

    def _landed(
        self, sample: int, event: GaitEvent, history: SampleHistory, refined: bool, number: int | None = None
    ) -> list[LiveStride]:
        """The stride ended by this contact, if its start is within reach; `number`: of one reported
        before.
        """
        # contacts by way may be reported in arrears, after later ones by pitch
        earlier = [e for e in self._events if e.time_s <= event.time_s or e.side != event.side]
        own = sorted(e.time_s for e in earlier if e.side == event.side and e.kind == "ic")
        if len(own) < 2 or own[-2] == own[-1]:  # two contacts may be refined to the same moment
            return []
        first, past = self._sample(own[-2]) - 1, sample + 1
        if not history.reaches(first, past):
            return []
        span = self._span(first, past, history, event.side)
        inside = tuple(e for e in earlier if e.time_s >= own[-2] or e.side != event.side)
        feet = self._turned_feet(max(0, first - self._near), past, history)
        strides = side_strides(event.side, GaitEvents(inside), feet, None, self._params)
        if not strides:
            return []
        stride = strides[-1]
        recent = self._recent[event.side]
        if recent and recent[-1].end_s != stride.start_s:
            recent.clear()
        recent.append(stride)
        near = find_flags(tuple(recent), self._params)[-1]
        flags = tuple(f for f in add_flag(stride, *near).flags if f not in LATER)
        figures, curves = early_figures(stride, span, self._setup.surface)
        values, reasons = _split(figures)
        final = self._setup.surface.protocol == "treadmill" or event.side not in self._setup.feet
        live_stride = LiveStride(
            n=self._count if number is None else number,
            side=event.side,
            start_s=stride.start_s,
            foot_off_s=stride.tc_s,
            end_s=stride.end_s,
            detected_s=(self._setup.first + sample) / self._setup.rate_hz,
            values=values,
            reasons=reasons,
            curves=curves,
            turn_rad=stride.turn_rad,
            flags=flags,
            counted=not flags,
            complete=final and refined,
        )
        self._last[event.side] = live_stride.n
        self._count += number is None
        if not final:
            wait = round(self._params.max_s * self._setup.rate_hz)
            self._pending.append(_Pending(live_stride, stride, self._sample(stride.end_s) + wait))
        return [live_stride]

    def _completed(self, sample: int, history: SampleHistory) -> list[LiveStride]:
        ready = [p for p in self._pending if self._left_again(p.stride)]
        self._pending = [p for p in self._pending if p not in ready]
        return [self._complete(p, sample, history) for p in ready]

    def _given_up(self, sample: int, history: SampleHistory) -> list[LiveStride]:
        """Strides without a following step: a stop. Each at its own sample, independent of block sizes."""
        ready = sorted((p for p in self._pending if p.until <= sample), key=lambda p: p.until)
        self._pending = [p for p in self._pending if p.until > sample]
        return [self._complete(p, p.until, history, *self._stopped(p.stride)) for p in ready]

    def _stopped(self, stride: Stride) -> tuple[StrideFlag, ...]:
        """Flag "last" if this foot has made no further contact; only the other foot may be missing."""
        on = any(e.side == stride.side and e.time_s > stride.end_s for e in self._events)
        return () if on else ("last",)

    def _complete(
        self, pending: _Pending, sample: int, history: SampleHistory, *late: StrideFlag
    ) -> LiveStride:
        context = self._context(pending.stride.start_s)
        first = self._sample(pending.stride.start_s) - 1
        figures: dict[str, Value] = dict.fromkeys(SPATIAL, "gap")
        if history.reaches(first, sample + 1):
            span = self._span(first, sample + 1, history)
            figures = late_figures(pending.stride, context, span, self._setup.surface)
        live_stride, (values, reasons) = pending.told, _split(figures)
        if figures["stride_length_m"] == "in_place":
            late = (*late, "in_place")
        flags = add_flag(replace(pending.stride, flags=live_stride.flags), *late).flags
        return replace(
            live_stride,
            flags=flags,
            counted=not flags,
            detected_s=(self._setup.first + sample) / self._setup.rate_hz,
            values={**live_stride.values, **values},
            reasons={k: v for k, v in live_stride.reasons.items() if k not in figures} | reasons,
            complete=True,
        )

    def _left_again(self, stride: Stride) -> bool:
        """Whether both feet used for the distances have left the floor, or landed again, since their
        foot-flats.
        """

        def moved(side: Side, since: float) -> bool:
            return any(e.side == side and e.time_s > since for e in self._events)

        opposite, landed = OTHER[stride.side], stride.opposite_ic_s
        return moved(stride.side, stride.end_s) and (
            landed is None or opposite not in self._setup.feet or moved(opposite, landed)
        )

    def _context(self, since: float) -> list[Stride]:
        """Strides of both feet that end later, and those that have only begun."""
        strides = []
        for side in self._setup.feet:
            contacts = [e.time_s for e in self._events if e.side == side and e.kind == "ic"]
            leavings = [e.time_s for e in self._events if e.side == side and e.kind == "tc"]
            for start, end in pairwise(contacts):
                if end < since:
                    continue
                off = next((t for t in leavings if start < t < end), None)
                landings = [
                    e.time_s
                    for e in self._events
                    if e.side != side and e.kind == "ic" and start < e.time_s < end
                ]
                opposite = landings[0] if len(landings) == 1 else None
                strides.append(Stride(side, start, off, end, opposite_ic_s=opposite))
            off = next((t for t in leavings if contacts and t > contacts[-1]), None)
            if off is not None:
                strides.append(Stride(side, contacts[-1], off, off))
        return sorted(strides, key=lambda s: (s.start_s, s.side))

    def _sample(self, time_s: float) -> int:
        return floor(time_s * self._setup.rate_hz + 1e-6) - self._setup.first

    def _turned_feet(self, first: int, past: int, history: SampleHistory) -> Orientations:
        """Orientations of both feet over samples first … past − 1, and their validity."""
        x = self._setup
        first = max(first, past - history.reach)
        t_s = np.arange(x.first + first, x.first + past) / x.rate_hz
        q, valid = history.floats("course", first, past), history.bools("course_valid", first, past)
        feet = {s: i for i, s in enumerate(x.courses) if s in FOOT.values()}
        by_segment: Mapping[Segment, Floats] = {s: q[:, i] for s, i in feet.items()}
        return Orientations(t_s, x.rate_hz, by_segment, {s: valid[:, i] for s, i in feet.items()}, "live")

    def _span(self, first: int, past: int, history: SampleHistory, side: Side | None = None) -> StrideSpan:
        """Samples first … past − 1 in the form required by the functions for whole recordings.

        Parameters
        ----------
        side : include the orientation of this foot and of the pelvis, and all angles; None = no angles.
        """
        x = self._setup
        t_s = np.arange(x.first + first, x.first + past) / x.rate_hz
        q, valid = history.floats("course", first, past), history.bools("course_valid", first, past)
        turned_by = {
            s: i for i, s in enumerate(x.courses) if side is not None and s in ("pelvis", FOOT[side])
        }
        by_segment: Mapping[Segment, Floats] = {s: q[:, i] for s, i in turned_by.items()}
        take = Orientations(
            t_s, x.rate_hz, by_segment, {s: valid[:, i] for s, i in turned_by.items()}, "live"
        )
        angles = None
        if side is not None:
            columns = history.floats("angles", first, past)
            named = {name: columns[:, i] for i, name in enumerate(x.angles)}
            angles = JointAngles(t_s, named, {}, headings=compute_headings(take))
        feet = None
        if x.feet:
            p, turned = history.floats("feet_p", first, past), history.floats("feet_q", first, past)
            still, is_valid = (
                history.bools("feet_still", first, past),
                history.bools("feet_valid", first, past),
            )
            patched = history.bools("feet_patched", first, past)
            feet = FootTracks(
                t_s=t_s,
                rate_hz=x.rate_hz,
                p={s: p[:, i] for i, s in enumerate(x.feet)},
                q={s: turned[:, i] for i, s in enumerate(x.feet)},
                still={s: still[:, i] for i, s in enumerate(x.feet)},
                valid={s: is_valid[:, i] for i, s in enumerate(x.feet)},
                patched={s: patched[:, i] for i, s in enumerate(x.feet)},
                linked=x.linked,
                source=x.source,
                body=x.body,
            )
        return StrideSpan(t_s, take.q, take.valid, angles, feet)


def _split(figures: Mapping[str, Value]) -> tuple[dict[str, float | None], dict[str, str]]:
    """Values, None for those with a reason; and the reasons."""
    values = {name: v if isinstance(v, float) else None for name, v in figures.items()}
    return values, {name: v for name, v in figures.items() if isinstance(v, str)}
