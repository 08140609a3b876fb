"""Live consistency check of linked sensors while walking: the distance of the two ends of each joint."""

from __future__ import annotations

from typing import Final

import numba
import numpy as np

from sagittal.core.body.erkf.health import RESIDUAL_MM, TOLD
from sagittal.core.body.tree import ImuTree
from sagittal.core.errors import Notice
from sagittal.core.frames import Bools, Floats
from sagittal.core.message import Message

WINDOW_S: Final = 5.0
"""Of movement, over which the distance is averaged. Right set-ups then have 3 to 17 mm live (five simulated
people, neura_walk), exchanged or late sensors 26 to 130."""


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _watch(residual, valid, still, ends, window, total, count, worst):  # type: ignore[no-untyped-def]
    """Accumulate squares (J,) of moving samples; `worst` (J,) receives the largest mean of a full window.

    Returns
    -------
    Whether a window was completed.
    """
    full = False
    for k in range(residual.shape[0]):
        at_rest = True
        for i in range(valid.shape[1]):
            at_rest &= still[k, i, 1]
        if at_rest:
            continue
        for j in range(ends.shape[0]):
            if not (valid[k, ends[j, 0]] and valid[k, ends[j, 1]]):
                continue
            total[j] += residual[k, j] ** 2
            count[j] += 1
            if count[j] == window:
                worst[j] = max(worst[j], total[j] / window)
                total[j], count[j] = 0.0, 0
                full = True
    return full


class JointWatch:
    """Reports each joint whose two ends are too far apart once; independent of the division into blocks."""

    def __init__(self, tree: ImuTree, rate_hz: float) -> None:
        self._joints = tree.joints
        n = len(tree.joints)
        self._ends = np.array([(j.proximal, j.distal) for j in tree.joints], np.int64).reshape(n, 2)
        self._window = round(WINDOW_S * rate_hz)
        self._total, self._count, self._worst = np.zeros(n), np.zeros(n, np.int64), np.zeros(n)
        self._told = np.zeros(n, np.bool_)

    def push(self, residual: Floats, valid: Bools, still: Bools) -> list[Notice]:
        """Process distances (T, J) in m, valid (T, n), still (T, n, 2)."""
        arguments = residual, valid, still, self._ends, self._window, self._total, self._count, self._worst
        if not _watch(*arguments):
            return []
        far = (1e3 * np.sqrt(self._worst) > RESIDUAL_MM[0]) & ~self._told
        if not far.any():
            return []
        self._told |= far
        code, severity, words = TOLD["joint_residual_mm"]
        notices = []
        for j in np.flatnonzero(far):
            name, apart = self._joints[j].name, 1e3 * float(np.sqrt(self._worst[j]))
            message = Message(words, of=name, value=apart, warn=RESIDUAL_MM[0])
            notices.append(Notice(code, message, sensor=name.split("-")[-1], severity=severity))
        return notices
