"""Second-by-second comparison of sensors after standing: labels first, then clocks and slips.

The rules are those for files (exchange.py, lags.py, slips.py), applied to the windows of the last seconds.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sagittal.core.agreement.exchange import (
    SensorExchange,
    Swap,
    choose_labels,
    compare_hips,
    judge_legs,
    undo_exchange,
)
from sagittal.core.agreement.joints import list_worn_joints
from sagittal.core.agreement.lags import SensorLag, find_sensor_lags
from sagittal.core.agreement.live_joints import LivePair, Pair, list_pairs, relabel
from sagittal.core.agreement.live_terms import LiveTerms, RawSecond, TermSecond
from sagittal.core.agreement.params import LiveAgreementParams
from sagittal.core.agreement.place_turns import PlaceTurns, find_turns, is_lasting, judge_turns
from sagittal.core.agreement.slips import SensorSlip, is_moving, question_strides
from sagittal.core.agreement.strides import choose_leg, find_largest_axis
from sagittal.core.agreement.terms import LevelMotion
from sagittal.core.agreement.windows import JointWindows
from sagittal.core.frames import FOOT, SHANK, SIDES, Bools, Floats, Segment

HIPS: Final[frozenset[Segment]] = frozenset(("pelvis", "thigh_l", "thigh_r"))


@dataclass(frozen=True)
class Verdict:
    """Result of the last seconds of walking, by the best labels.

    Parameters
    ----------
    t_s : end of the last window, on the axis of the recording. exchange : evidence on the labels. lags :
        those above the limits. slips : newly detected ones. back : sensors with a known slip that has been
        reversed.
    """

    t_s: float
    exchange: SensorExchange
    lags: tuple[SensorLag, ...] = ()
    slips: tuple[SensorSlip, ...] = ()
    back: frozenset[Segment] = frozenset()


class SensorComparison:
    """Comparison of the sensors after one standing period.

    Parameters
    ----------
    segments : of the columns of a second. first : sample of the axis after `standing`.
    """

    def __init__(
        self,
        segments: Sequence[Segment],
        standing: RawSecond,
        first: int,
        rate_hz: float,
        thin: int,
        params: LiveAgreementParams,
    ) -> None:
        self._params, self._rate_hz, self._first = params, rate_hz, first
        self._column: dict[Segment, int] = {s: i for i, s in enumerate(segments)}
        joints = params.agreement.joints
        chunk = round(joints.chunk_s * rate_hz / thin)
        self._terms = LiveTerms(standing, rate_hz, joints)
        self._pairs = {frozenset(x): LivePair(x, rate_hz / thin, chunk, joints) for x in list_pairs(segments)}
        self._half = 0.5 * joints.window_chunks * chunk * thin / rate_hz
        self._chunk_s = chunk * thin / rate_hz
        self._exchange: SensorExchange | None = None
        self._worn_as: dict[Segment, Segment] = {}
        """Segment by the labels that fit → as stated; once they are settled."""
        self._agreed = 0
        self._likely: Swap | None = None
        self._moments = np.zeros((len(segments), 3, 3))
        self._axes: dict[Segment, Floats] = {}

    def push(self, new: RawSecond, slipped: Collection[SensorSlip] = ()) -> Verdict | None:
        """Add a second; returns a verdict, None without walking or while the labels are undecided.

        Parameters
        ----------
        slipped : slips already reported.
        """
        terms = self._terms.push(new)
        if terms is None:
            return None
        self._moments += terms.moments
        end_s = (self._first + terms.start) / self._rate_hz + self._chunk_s
        fresh = [x for x in self._pairs.values() if self._extend(x, terms, end_s - self._half)]
        if not fresh:
            return None
        if self._exchange is None:
            self._settle_labels()
            return None if self._exchange is None else Verdict(end_s, self._exchange)
        joints = relabel(self._exchange.swap, {k: x.read() for k, x in self._pairs.items()})
        slips, back = self._find_slips(joints, slipped)
        return Verdict(end_s, self._exchange, self._find_lags(joints), slips, back)

    def _extend(self, pair: LivePair, terms: TermSecond, middle_s: float) -> bool:
        a, b = pair.names
        return pair.push(terms, (self._column[a], self._column[b]), middle_s)

    def _settle_labels(self) -> None:
        """Accept labels that were found several times in a row, sides included; afterwards only joints are
        continued.
        """
        p = self._params
        counts = [len(x) for x in self._pairs.values()]
        patient = max(counts) >= p.patient_windows
        if min(counts) < p.least_windows and not patient:
            return
        swap: Swap = ()
        ratio, cosine = 0.0, None
        heard = frozenset(s for k, x in self._pairs.items() if len(x) for s in k)
        compared = {k: x.read() for k, x in self._pairs.items() if k <= heard}
        if len(list_worn_joints(heard)) > 1:
            swap, ratio = choose_labels(compared, p.agreement.exchange)
        self._agreed = self._agreed + 1 if swap == self._likely else 1
        self._likely = swap
        if self._agreed < p.confirmed:
            return
        if heard >= HIPS:
            start_s, motions = self._read_motions(undo_exchange(swap, {s: s for s in self._column}))
            joints = {k: replace(w, t_s=w.t_s - start_s) for k, w in relabel(swap, compared).items()}
            cosine = compare_hips(motions, joints, self._rate_hz, p.agreement.exchange)
            sided = any({SHANK[side], FOOT[side]} <= heard for side in SIDES)
            if cosine is None and sided and not patient:
                return
        self._exchange = judged_exchange = judge_legs(swap, ratio, cosine, p.agreement.exchange)
        self._worn_as = names = undo_exchange(judged_exchange.swap, {s: s for s in self._column})
        kept_pairs = {frozenset((names[a], names[b])) for a, b in list_worn_joints(names)}
        self._pairs = {k: x for k, x in self._pairs.items() if k in kept_pairs}

    def _read_motions(self, worn_as: Mapping[Segment, Segment]) -> tuple[float, dict[Segment, LevelMotion]]:
        """Start on the axis, and the motions since; segment by the best labels → as declared."""
        start_s = (self._first + self._terms.motion_start) / self._rate_hz
        return start_s, {s: self._terms.read_motion(self._column[x])[0] for s, x in worn_as.items()}

    def _find_lags(self, joints: Mapping[Pair, JointWindows]) -> tuple[SensorLag, ...]:
        p = self._params
        late = [w.choose(np.arange(len(w.t_s)) >= len(w.t_s) - p.lag_windows) for w in joints.values()]
        return tuple(x for x in find_sensor_lags(late, p.agreement.lags) if x.told)

    def _find_slips(
        self, joints: Mapping[Pair, JointWindows], slipped: Collection[SensorSlip]
    ) -> tuple[tuple[SensorSlip, ...], frozenset[Segment]]:
        """New slips, and sensors whose reported slip has been reversed."""
        params = self._params.agreement.slips
        axes = self._find_axes()
        moving = [w.choose(self._is_moving(joint, w)) for joint, w in joints.items()]
        turns = find_turns(moving, axes, params)
        since_s = max((x.t_s[-1] for x in turns.values()), default=0.0) - params.near_s
        reported = {x.segment for x in slipped}
        new_slips = []
        steps = {
            s: x
            for s, x in judge_turns(turns, self._half, params, since_s).items()
            if s not in reported and self._is_walked(turns[s], x.at_s)
        }
        for segment, step in steps.items() if len(steps) == 1 else ():
            needed = {segment, *choose_leg(segment)} & set(self._worn_as)
            start_s, motions = self._read_motions({s: self._worn_as[s] for s in needed})
            valid = self._terms.read_motion(self._column[self._worn_as[segment]])[1]
            own = replace(step, at_s=step.at_s - start_s)
            slip = question_strides(
                segment, own, axes[segment], motions, valid, self._rate_hz, self._half, params
            )
            if slip is not None:
                new_slips.append(replace(slip, at_s=slip.at_s + start_s))
        back = [
            x.segment
            for x in slipped
            if x.segment in turns and not is_lasting(turns[x.segment], x.at_s, x.turn_rad, self._half, params)
        ]
        return tuple(new_slips), frozenset(back)

    def _is_walked(self, turns: PlaceTurns, at_s: float) -> bool:
        """Whether there was walking at a moment, or enough walking since."""
        earlier, later = turns.t_s <= at_s - self._half, turns.t_s >= at_s + self._half
        during = ~earlier & ~later
        return bool(during.any()) or int(later.sum()) >= self._params.pause_windows

    def _find_axes(self) -> dict[Segment, Floats]:
        """Main rotation axis of every leg sensor, with the same sign as in the previous second."""
        for s, stated in self._worn_as.items():
            if s == "pelvis":
                continue
            axis = find_largest_axis(self._moments[self._column[stated]])
            self._axes[s] = -axis if s in self._axes and axis @ self._axes[s] < 0.0 else axis
        return dict(self._axes)

    def _is_moving(self, joint: Pair, w: JointWindows) -> Bools:
        """Windows (m,) with swinging legs."""
        stated = {s: self._worn_as[s] for s in joint}
        swing = self._pairs[frozenset(stated.values())].read_swing()
        return is_moving(
            w, {s: swing[x] for s, x in stated.items() if s != "pelvis"}, self._params.agreement.slips
        )
