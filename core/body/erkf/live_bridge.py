"""What a lost sensor is taken to measure, sample by sample: core/body/erkf/gaps.py with a memory."""

from __future__ import annotations

import numba
import numpy as np

from core.body.erkf.gaps import HOLD_S, POSTURE_S, carrier, guides
from core.body.tree import ImuTree
from core.frames import GRAVITY, Bools, Floats
from core.rotation import conjugate, multiply, to_matrix


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _mean_up(ring, seen, out):  # type: ignore[no-untyped-def]
    """Write the direction of the mean of the last `seen` specific forces in a ring (W, 3)."""
    W = ring.shape[0]
    first = seen - min(seen, W)
    for c in range(3):
        total = 0.0
        for k in range(first, seen):
            total += ring[k % W, c]
        out[c] = total
    length = np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)
    for c in range(3):
        out[c] /= length


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def bridge(  # type: ignore[no-untyped-def]
    acc, gyr, valid, excess, bias, hold, guide, carry, along, held, lost, seen, ring, up, out_acc, out_gyr
):
    """Correct and bridge a block; `held`, `lost`, `seen`, `ring` and `up` are advanced in place.

    Parameters
    ----------
    acc, gyr : (T, n, 3) as measured. excess, bias : (n, 3) what is taken off. guide : (n, n) indices, −1 =
    none left. carry : (n,) index or −1. along : (n, 3, 3) axes of the carrier in those of the sensor.
    held : (n, 6) last measured. lost : (n,) samples of the gap that is going on. ring : (n, W, 3).
    """
    n = acc.shape[1]
    level = np.empty(3)
    for k in range(acc.shape[0]):
        for i in range(n):
            if valid[k, i]:
                lost[i] = 0
                for c in range(3):
                    held[i, c] = acc[k, i, c] - excess[i, c]
                    held[i, 3 + c] = gyr[k, i, c] - bias[i, c]
            else:
                lost[i] += 1
                if lost[i] == 1:
                    _mean_up(ring[i], seen[0], up[i])
        for i in range(n):
            for c in range(3):
                out_acc[k, i, c], out_gyr[k, i, c] = held[i, c], held[i, 3 + c]
            if lost[i] <= hold:
                continue
            for c in range(3):
                out_acc[k, i, c], out_gyr[k, i, c] = GRAVITY * up[i, c], 0.0
            for g in range(n):
                j = guide[i, g]
                if j < 0:
                    break
                if not valid[k, j]:
                    continue
                _mean_up(ring[j], seen[0], level)
                turn = held[j, 3] * level[0] + held[j, 4] * level[1] + held[j, 5] * level[2]
                for c in range(3):
                    out_gyr[k, i, c] = turn * up[i, c]
            j = carry[i]
            if j >= 0 and valid[k, j]:
                for c in range(3):
                    f = w = 0.0
                    for e in range(3):
                        f += along[i, c, e] * held[j, e]
                        w += along[i, c, e] * held[j, 3 + e]
                    out_acc[k, i, c], out_gyr[k, i, c] = f, w
        slot = seen[0] % ring.shape[1]
        for i in range(n):
            for c in range(3):
                ring[i, slot, c] = held[i, c]
        seen[0] += 1


class Bridge:
    """Corrected signals without holes; any division into blocks gives the same bits.

    Parameters
    ----------
    excess : (n, 3) of specific force at rest, bias : (n, 3) of angular rate at rest, both taken off.
    """

    def __init__(self, tree: ImuTree, excess: Floats, bias: Floats, rate_hz: float) -> None:
        n = len(tree.imus)
        self._excess, self._bias = np.ascontiguousarray(excess), np.ascontiguousarray(bias)
        self._hold = round(HOLD_S * rate_hz)
        self._guide = np.full((n, n), -1, np.int64)
        self._carry = np.full(n, -1, np.int64)
        self._along = np.tile(np.eye(3), (n, 1, 1))
        mount = to_matrix(tree.q_mount)
        for i in range(n):
            found = guides(tree, i)
            self._guide[i, : len(found)] = found
            j = carrier(tree, i)
            if j is not None:
                self._carry[i] = j
                self._along[i] = to_matrix(multiply(conjugate(tree.q_mount[i]), tree.q_mount[j]))
        # before its first sample a sensor stands upright
        self._held = np.zeros((n, 6))
        self._held[:, :3] = GRAVITY * mount[:, 1]
        self._lost = np.zeros(n, np.int64)
        self._ring = np.tile(self._held[:, None, :3], (1, round(POSTURE_S * rate_hz), 1))
        self._seen = np.array([self._ring.shape[1]], np.int64)
        self._up = mount[:, 1].copy()

    def push(self, acc: Floats, gyr: Floats, valid: Bools) -> tuple[Floats, Floats]:
        """Specific force and angular rate (T, n, 3) with every lost sample filled."""
        out_acc, out_gyr = np.empty(acc.shape), np.empty(acc.shape)
        bridge(
            acc, gyr, valid, self._excess, self._bias, self._hold, self._guide, self._carry, self._along,
            self._held, self._lost, self._seen, self._ring, self._up, out_acc, out_gyr,
        )  # fmt: skip
        return out_acc, out_gyr
