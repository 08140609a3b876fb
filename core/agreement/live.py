"""Consistency checks between the sensors of a live recording: reported during walking, corrected in the
analysis.

Checks start at quiet standing for calibration; results depend only on the samples, not on their division into
blocks. Incoming samples are only collected; the comparison is deferred until real-time feedback has been
served.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sagittal.core.agreement.exchange import undo_exchange
from sagittal.core.agreement.joints import list_worn_joints
from sagittal.core.agreement.live_comparison import SensorComparison, Verdict
from sagittal.core.agreement.live_terms import RawSecond
from sagittal.core.agreement.params import LiveAgreementParams
from sagittal.core.agreement.slips import SensorSlip, compile_agreement_kernels
from sagittal.core.agreement.tell_live import take_back, tell_exchange_now, tell_lag_now, tell_slip_now
from sagittal.core.agreement.terms import find_thinning
from sagittal.core.errors import Notice
from sagittal.core.frames import Segment
from sagittal.core.timeline.columns import find_columns, take_columns
from sagittal.core.timeline.live import UniformBlock

STANDING: Final = 2
"""Seconds of the standing from which biases and tilts are learnt."""

Key = tuple[str, tuple[Segment, ...]]
"""Code and sensors, by the labels that fit."""


@dataclass(frozen=True)
class _Said:
    """An active notice: the sensors concerned by actual segment, and consecutive verdicts without it."""

    notice: Notice
    worn: tuple[Segment, ...]
    slip: SensorSlip | None = None
    missed: int = 0


class LiveAgreement:
    """Collects incoming samples and compares the sensors on request.

    Parameters
    ----------
    segments : of the columns of the blocks.
    """

    def __init__(
        self, segments: Sequence[Segment], rate_hz: float, params: LiveAgreementParams | None = None
    ) -> None:
        self._params = params or LiveAgreementParams()
        joints = list_worn_joints(segments)
        self._worn = tuple(s for s in segments if any(s in joint for joint in joints))
        self._columns = find_columns(self._worn, segments)
        self._rate_hz = rate_hz
        self._thin = find_thinning(rate_hz, self._params.agreement.joints)
        chunk_s = self._params.agreement.joints.chunk_s
        self._second = self._thin * round(chunk_s * rate_hz / self._thin)
        self._last: deque[RawSecond] = deque()  # never less than the standing
        self._held = 0
        self._second_at: int | None = None  # first sample of the second that is collected; None: nobody stood
        self._due: deque[SensorComparison | RawSecond] = deque()
        self._comparison: SensorComparison | None = None
        self._said: dict[Key, _Said] = {}
        self._runs: dict[Key, int] = {}

    @property
    def doubts(self) -> Mapping[Segment, str]:
        """Segment → code of the active notice about its sensor."""
        return {s: x.notice.code for x in self._said.values() for s in x.worn}

    def push(self, block: UniformBlock, stood: Sequence[int] = ()) -> None:
        """Collect the next samples.

        Parameters
        ----------
        stood : samples of the axis at which a standing period of all sensors ended, in the block or at its
            end, in order.
        """
        if not len(self._worn):
            return
        start = 0
        for stood_at in stood:
            self._collect(block, start, stood_at - block.first)
            start = stood_at - block.first
            self._second_at = stood_at
            standing = self._read_last(STANDING * self._second)
            self._due.append(
                SensorComparison(self._worn, standing, stood_at, self._rate_hz, self._thin, self._params)
            )
        self._collect(block, start, len(block))

    def forget(self) -> None:
        """Start over with the next standing period, after a correction by the therapist."""
        self._second_at = self._comparison = None
        self._due.clear()
        self._said, self._runs = {}, {}

    def compare(self) -> list[Notice]:
        """Process the completed seconds and return new notices."""
        fresh: list[Notice] = []
        while self._due:
            one = self._due.popleft()
            if isinstance(one, SensorComparison):
                self._comparison, self._runs = one, {}
                self._said = {k: x for k, x in self._said.items() if x.slip is None}
            elif self._comparison is not None:
                slips = [x.slip for x in self._said.values() if x.slip is not None]
                verdict = self._comparison.push(one, slips)
                if verdict is not None:
                    fresh += self._tell(verdict)
        return fresh

    def _collect(self, block: UniformBlock, start: int, stop: int) -> None:
        """Append rows of a block; after the first standing period every full second is queued."""
        while start < stop:
            end = stop
            if self._second_at is not None:
                end = min(stop, self._second_at + self._second - block.first)
            part = slice(start, end)
            selected = take_columns(block.acc[part], block.gyr[part], block.valid[part], self._columns)
            self._last.append(RawSecond(*selected))
            self._held += end - start
            while self._held - len(self._last[0].acc) >= STANDING * self._second:
                self._held -= len(self._last.popleft().acc)
            if self._second_at is not None and block.first + end == self._second_at + self._second:
                self._due.append(self._read_last(self._second))
                self._second_at += self._second
            start = end

    def _read_last(self, n: int) -> RawSecond:
        """The last samples, at most n."""
        return RawSecond(
            np.concatenate([x.acc for x in self._last])[-n:],
            np.concatenate([x.gyr for x in self._last])[-n:],
            np.concatenate([x.valid for x in self._last])[-n:],
        )

    def _tell(self, verdict: Verdict) -> list[Notice]:
        """New notices of a verdict, including those that no longer hold."""
        p = self._params
        swap = verdict.exchange.swap
        holds: dict[Key, _Said] = {}
        if swap:
            moved = tuple(dict.fromkeys(s for pair in swap for s in pair))
            notice = tell_exchange_now(verdict.exchange, verdict.t_s)
            holds[notice.code, moved] = _Said(notice, moved)
        names = undo_exchange(swap, {s: s for s in self._worn})
        for lag in verdict.lags:
            notice = tell_lag_now(lag, p.agreement.lags, verdict.t_s)
            holds[notice.code, lag.sensors] = _Said(notice, tuple(names[s] for s in lag.sensors))
        for slip in verdict.slips:
            notice = tell_slip_now(slip)
            holds[notice.code, (slip.segment,)] = _Said(notice, (names[slip.segment],), slip)
        self._runs = {k: self._runs.get(k, 0) + 1 for k in holds}
        fresh = []
        for key, one in holds.items():
            ready = self._runs[key] >= p.confirmed or key[0] == "sensors_exchanged"
            if key in self._said:
                self._said[key] = replace(self._said[key], missed=0)
            elif ready:
                self._said[key] = one
                fresh.append(one.notice)
        return fresh + self._take_back(holds, verdict)

    def _take_back(self, holds: Mapping[Key, _Said], verdict: Verdict) -> list[Notice]:
        """Notices that have been absent from the verdicts for some time."""
        fresh = []
        for key, one in list(self._said.items()):
            if key in holds or (one.slip is not None and one.slip.segment not in verdict.back):
                continue
            self._said[key] = replace(one, missed=one.missed + 1)
            if self._said[key].missed >= self._params.cleared:
                del self._said[key]
                fresh.append(take_back(one.notice, key[1], verdict.t_s))
        return fresh


def compile_live_agreement() -> None:
    """Compile the kernels with the types used by a stream, so that the first recording is not delayed."""
    compile_agreement_kernels()
    n = 200
    wave = np.random.default_rng(0).normal(size=(2, 10 * n, 7, 3))
    segments: tuple[Segment, ...] = (
        "pelvis", "thigh_l", "thigh_r", "shank_l", "shank_r", "foot_l", "foot_r",
    )  # fmt: skip
    watch = LiveAgreement(segments, 100.0)
    valid = np.ones((10 * n, 7), np.bool_)
    watch.push(UniformBlock(0, np.arange(10 * n) / 100.0, wave[0], wave[1], valid, ~valid), (n,))
    watch.compare()
