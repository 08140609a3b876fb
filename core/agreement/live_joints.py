"""Streaming comparison at joints: the sums of the last seconds, and the windows solved from them."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from sagittal.core.agreement.exchange import SWAPS, Swap, undo_exchange
from sagittal.core.agreement.joints import LEG_JOINTS, list_worn_joints
from sagittal.core.agreement.live_terms import TermSecond
from sagittal.core.agreement.params import JointParams
from sagittal.core.agreement.windows import JointSums, JointWindows, read_windows
from sagittal.core.frames import Floats, Segment

KEPT: Final = 120
"""Windows that are kept: a slip is told from those within 20 s of it on either side, and the last seconds."""

NOW: Final = np.zeros(1, np.int64)

Pair = tuple[Segment, Segment]


class LivePair:
    """Two sensors compared second by second.

    Parameters
    ----------
    names : as in `JointWindows`. rate_hz : of the terms. chunk : their samples in a second.
    """

    def __init__(self, names: Pair, rate_hz: float, chunk: int, params: JointParams) -> None:
        self.names = names
        self._rate_hz, self._chunk, self._params = rate_hz, chunk, params
        self._sums = JointSums.empty(params.window_chunks, round(params.widest_s * rate_hz))
        self._power: deque[tuple[float, float]] = deque(maxlen=params.window_chunks)
        self._rows = np.zeros((KEPT, 14))  # middle, as solved, swing of both; the newest last
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def push(self, new: TermSecond, columns: tuple[int, int], middle_s: float) -> bool:
        """Add a second; returns whether the window ending with it is usable.

        Parameters
        ----------
        columns : of the two sensors. middle_s : of that window.
        """
        i, j = columns
        self._sums.forget_first()
        self._sums.add(slice(-1, None), new.M[i], new.M[j], new.usable[i], new.usable[j], self._chunk)
        self._power.append((float(new.power[i]), float(new.power[j])))
        if len(self._power) < self._params.window_chunks:
            return False
        solved = self._sums.solve(NOW, self._chunk, self._params)
        if len(solved):
            self._rows[:-1] = self._rows[1:]
            self._rows[-1, 0], self._rows[-1, 1:12] = middle_s, solved[0]
            self._rows[-1, 12:] = np.mean(self._power, axis=0)
            self._count = min(self._count + 1, KEPT)
        return bool(len(solved))

    def read(self) -> JointWindows:
        """The stored windows."""
        rows = self._rows[KEPT - self._count :]
        return read_windows(
            self.names, rows[:, 1:12], rows[:, 0].copy(), self._rate_hz, self._chunk, self._params,
            self._chunk / self._rate_hz,
        )  # fmt: skip

    def read_swing(self) -> dict[Segment, Floats]:
        """Sensor → mean square of its rate in every window (m,), rad²/s²."""
        rows = self._rows[KEPT - self._count :]
        return {self.names[0]: rows[:, 12], self.names[1]: rows[:, 13]}


def list_pairs(segments: Iterable[Segment]) -> tuple[Pair, ...]:
    """Joints of the declared labels, and pairs that would be joints if sensors were swapped."""
    instrumented = frozenset(segments)
    pairs: dict[frozenset[Segment], Pair] = {frozenset(x): x for x in list_worn_joints(instrumented)}
    for swap in SWAPS:
        if all(s in instrumented for pair in swap for s in pair):
            names = undo_exchange(swap, {s: s for s in instrumented})
            for a, b in list_worn_joints(instrumented):
                pairs.setdefault(frozenset((names[a], names[b])), (names[a], names[b]))
    return tuple(pairs.values())


def relabel(swap: Swap, pairs: Mapping[frozenset[Segment], JointWindows]) -> dict[Pair, JointWindows]:
    """Joints by the best labels, for the available pairs."""
    names = undo_exchange(swap, {s: s for x in pairs for s in x})
    relabelled = {}
    for a, b in LEG_JOINTS:
        w = pairs.get(frozenset((names[a], names[b]))) if a in names and b in names else None
        if w is not None:
            relabelled[a, b] = replace(w if w.first == names[a] else w.turn_round(), first=a, second=b)
    return relabelled
