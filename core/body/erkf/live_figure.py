"""Live poses of a chain of sensors by the ErKF, and the reduced output without a complete chain."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numba
import numpy as np

from sagittal.core.body.erkf.live_sensors import FilteredSensors, FootPaths
from sagittal.core.body.erkf.live_watch import JointWatch
from sagittal.core.body.live_estimator import BodyBlock, FootBlock, MeasuredBlock, list_worn_feet
from sagittal.core.errors import Notice
from sagittal.core.estimators import ERKF, LIVE_LINKED_PATHS, LIVE_SINGLE_PATHS, NO_FIGURE, LiveMethod
from sagittal.core.frames import FOOT, SHANK, SIDES, THIGH, Segment

LEVEL_S: Final = 0.1
"""The figure is let down or lifted to the floor of the foot that rests within about so long: for the eye."""


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _level(p, feet, still, valid, ankle, share, floor):  # type: ignore[no-untyped-def]
    """Subtract the floor height, determined by the resting feet, from positions p (T, n, 3) in place."""
    for k in range(p.shape[0]):
        heights, count = 0.0, 0
        for f in range(feet.shape[0]):
            if still[k, f] and valid[k, f]:
                heights += p[k, feet[f], 2] - ankle
                count += 1
        if count:
            floor[0] += share * (heights / count - floor[0])
        for i in range(p.shape[1]):
            p[k, i, 2] -= floor[0]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _tell(q, p, valid, still, feet, displayed, known, whole, foot_q, foot_p, stands, available):  # type: ignore[no-untyped-def]
    """Write the validity of segments q (T, n, 4), p (T, n, 3), and the paths of the feet.

    Parameters
    ----------
    valid, still : (T, n), (T, n, 2) of the sensors. feet, displayed : columns of the feet, of the displayed
        segments. known : (T, n) written. whole : (T,) written, all displayed segments are known.
    foot_q, foot_p, stands, available : (T, F, ·) written, as `FootBlock`.
    """
    for k in range(q.shape[0]):
        for i in range(q.shape[1]):
            known[k, i] = valid[k, i] and np.isfinite(q[k, i, 0])
        whole[k] = True
        for i in displayed:
            whole[k] = whole[k] and known[k, i]
        for f in range(feet.shape[0]):
            i = feet[f]
            stands[k, f], available[k, f] = still[k, i, 0], known[k, i]
            for c in range(4):
                foot_q[k, f, c] = q[k, i, c]
            for c in range(3):
                foot_p[k, f, c] = p[k, i, c]


class LinkedBody:
    """Linked pelvis and legs."""

    method: LiveMethod = ERKF.name
    attitudes: tuple[Segment, ...] = ()

    def __init__(
        self, segments: Sequence[Segment], filtered: FilteredSensors, ankle_height: float, rate_hz: float
    ) -> None:
        self.segments = tuple(segments)
        tree = filtered.tree
        self._filtered, self._ankle = filtered, ankle_height
        feet = list_worn_feet(segments)
        self._feet = np.array([self.segments.index(f) for f in feet], np.int64)
        legs = [s for s in SIDES if {THIGH[s], SHANK[s], FOOT[s]} <= set(segments)]
        displayed: list[Segment] = ["pelvis", *(x for s in legs for x in (THIGH[s], SHANK[s], FOOT[s]))]
        self._shown = np.array([self.segments.index(s) for s in displayed], np.int64)
        self.linked = len(feet) == 2 and not (set(self._feet.tolist()) & set(tree.roots()))
        self.source = LIVE_LINKED_PATHS if self.linked else LIVE_SINGLE_PATHS
        self._watch, self._notices = JointWatch(tree, rate_hz), list[Notice]()
        self._share, self._floor = min(1.0, 1.0 / (LEVEL_S * rate_hz)), np.zeros(1)

    @property
    def broken(self) -> bool:
        """Whether the filter has failed."""
        return self._filtered.broken

    def push(self, raw: MeasuredBlock) -> BodyBlock:
        """Process the next samples; the first block is the whole standing window."""
        tracked = self._filtered.push(raw)
        signals, q, p = tracked.signals, tracked.q, tracked.p
        self._notices += self._watch.push(tracked.residual, signals.valid, signals.still)
        T, n = signals.valid.shape
        is_known, whole = np.empty((T, n), np.bool_), np.empty(T, np.bool_)
        F = len(self._feet)
        paths = FootBlock(
            np.empty((T, F, 3)), np.empty((T, F, 4)), np.empty((T, F), np.bool_), np.empty((T, F), np.bool_),
            (signals.patched & ~signals.still[:, :, 0]).take(self._feet, axis=1),
        )  # fmt: skip
        _tell(
            q, p, signals.valid, signals.still, self._feet, self._shown, is_known, whole, paths.q, paths.p,
            paths.still, paths.valid,
        )  # fmt: skip
        _level(p, self._feet, paths.still, paths.valid, self._ankle, self._share, self._floor)
        return BodyBlock(q, p, is_known, whole, paths)

    def drain_notices(self) -> list[Notice]:
        """Notices on joints whose ends are too far apart."""
        fresh, self._notices = self._notices, []
        return fresh


class UnlinkedSensors:
    """Sensors that do not form a body: independent orientations, and the paths of any feet among them."""

    method: LiveMethod = NO_FIGURE
    linked = False
    source = LIVE_SINGLE_PATHS

    def __init__(self, segments: Sequence[Segment], feet: FootPaths | None) -> None:
        self.segments = self.attitudes = tuple(segments)
        self._feet = feet

    @property
    def broken(self) -> bool:
        """Whether the filter of the feet has failed."""
        return self._feet is not None and self._feet.broken

    def push(self, raw: MeasuredBlock) -> BodyBlock:
        """Process the next samples; the first block is the whole standing window."""
        T = len(raw.valid)
        q = np.stack([raw.turned[s] for s in self.segments], axis=1)
        paths = make_empty_paths(T) if self._feet is None else self._feet.push(raw)
        return BodyBlock(q, np.full((*q.shape[:2], 3), np.nan), raw.valid, np.zeros(T, np.bool_), paths)

    def drain_notices(self) -> list[Notice]:
        """Always empty: there is nothing that could fail."""
        return []


def make_empty_paths(samples: int) -> FootBlock:
    """Empty paths of a sensor set without feet."""
    none = np.zeros((samples, 0), np.bool_)
    return FootBlock(np.zeros((samples, 0, 3)), np.zeros((samples, 0, 4)), none, none, none)
