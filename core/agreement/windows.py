"""Comparison of two sensors at their joint, window by window: lag, positions and misfit.

In one window, at one lag, the positions a and b of the joint in the axes of the two sensors and the rotation
d between their level frames minimise mean |A [a; 1] − Rz(d) B [b; 1]|² + ε² (|a|² + |b|²), A and B as in
terms.py. Only sums of products over the window are needed: they are computed once per second and lag and
summed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np
from numpy.typing import NDArray

from sagittal.core.agreement.params import JointParams, JointSumParams
from sagittal.core.agreement.terms import TERMS, SensorTerms, TermsPart
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.signals.inner import inner_njit


@dataclass(frozen=True, eq=False)
class JointWindows:
    """Windows of one joint over the recording; only those with movement and without lost samples.

    Parameters
    ----------
    first, second : its sensors. t_s : (m,) middles of the windows.
    lag_s : (m,) delay of the second sensor relative to the first. certain : (m,) the minimum misfit is inside
        the range of lags. residual : (m,) misfit at that lag relative to the joint acceleration.
    places : (m, 6) joint position in the axes of first and second, m. turn : (m,) heading of the second level
        frame in the first, rad. width_s : of a window. step_s : between windows.
    """

    first: Segment
    second: Segment
    t_s: Floats
    lag_s: Floats
    certain: Bools
    residual: Floats
    places: Floats
    turn: Floats
    width_s: float
    step_s: float

    @property
    def start_s(self) -> float:
        """Start of the first window, s; infinite without one."""
        return float(self.t_s[0]) - 0.5 * self.width_s if len(self.t_s) else np.inf

    def place_in(self, segment: Segment) -> Floats:
        """Position (m, 3) of the joint in the axes of one of the two sensors, m."""
        return self.places[:, :3] if segment == self.first else self.places[:, 3:]

    def choose(self, mask: Bools) -> JointWindows:
        """The same joint restricted to some of its windows (m,)."""
        return JointWindows(
            self.first, self.second, self.t_s[mask], self.lag_s[mask], self.certain[mask],
            self.residual[mask], self.places[mask], self.turn[mask], self.width_s, self.step_s,
        )  # fmt: skip

    def turn_round(self) -> JointWindows:
        """The same joint seen from the other sensor."""
        places = np.concatenate((self.places[:, 3:], self.places[:, :3]), axis=1)
        return replace(
            self, first=self.second, second=self.first, lag_s=-self.lag_s, places=places, turn=-self.turn
        )


def compare_at_joint(
    names: tuple[Segment, Segment],
    first: SensorTerms | TermsPart,
    second: SensorTerms | TermsPart,
    params: JointParams,
) -> JointWindows:
    """Solve every window of a joint."""
    rate = first.rate_hz
    chunk, widest = round(params.chunk_s * rate), round(params.widest_s * rate)
    n = min(len(first.M), len(second.M))
    chunks = max(0, (n - 2 * widest) // chunk)
    sums = JointSums.empty(chunks, widest)
    sums.add(slice(None), first.M[:n], second.M[:n], first.usable[:n], second.usable[:n], chunk)
    width = params.window_chunks
    step = int(np.clip(np.ceil(chunks / params.windows), 1, max(1, width // 2)))
    solved = sums.solve(np.arange(0, max(0, chunks - width + 1), step), chunk, params)
    return read_windows(
        names, solved, (solved[:, 0] * chunk + widest) / rate, rate, chunk, params, step_s=step * chunk / rate
    )


def read_windows(
    names: tuple[Segment, Segment],
    solved: Floats,
    t_s: Floats,
    rate_hz: float,
    chunk: int,
    params: JointParams,
    step_s: float,
) -> JointWindows:
    """Solved windows (m, 11) of `JointSums.solve` in seconds; t_s (m,) their middles."""
    return JointWindows(
        first=names[0],
        second=names[1],
        t_s=t_s,
        lag_s=solved[:, 1] / rate_hz,
        certain=solved[:, 2] > 0.5,
        residual=solved[:, 3],
        places=solved[:, 4:10],
        turn=solved[:, 10],
        width_s=params.window_chunks * chunk / rate_hz,
        step_s=step_s,
    )


@dataclass(frozen=True, eq=False)
class JointSums:
    """Products of two sensors' terms, summed by chunk and lag.

    Parameters
    ----------
    ok : (chunks,) no sample of the chunk was lost, at any lag. AA : (chunks, 4, 4).
    BB : (chunks, lags, 4, 4). AB : (chunks, lags, 3, 4, 4) horizontal along, horizontal across, vertical. The
        first lag is the most negative one.
    """

    ok: Bools
    AA: Floats
    BB: Floats
    AB: Floats

    @classmethod
    def empty(cls, chunks: int, widest: int) -> JointSums:
        """No products yet; widest : largest lag in samples."""
        lags = 2 * widest + 1
        return cls(
            np.zeros(chunks, np.bool_),
            np.zeros((chunks, TERMS, TERMS)),
            np.zeros((chunks, lags, TERMS, TERMS)),
            np.zeros((chunks, lags, 3, TERMS, TERMS)),
        )

    def add(self, part: slice, A: Floats, B: Floats, ok_a: Bools, ok_b: Bools, chunk: int) -> None:
        """Add the products of A and B (n, 3, 4) to some of the chunks, which must be zero before."""
        widest = self.BB.shape[1] // 2
        _sum_products(
            A, B, ok_a, ok_b, chunk, widest, self.ok[part], self.AA[part], self.BB[part], self.AB[part]
        )

    def forget_first(self) -> None:
        """Drop the first chunk and append an empty one."""
        for x in (self.ok, self.AA, self.BB, self.AB):
            x[:-1] = x[1:]
            x[-1] = 0

    def solve(self, starts: NDArray[np.int64], chunk: int, params: JointSumParams) -> Floats:
        """Windows (m, 11) starting at these chunks: middle in chunks, lag in samples, certain, misfit,
        positions, turn; m is the number of usable ones.
        """
        width = params.window_chunks
        solved = np.zeros((len(starts), 11))
        ridge = (params.noise_mps2 / params.place_sd_m) ** 2 / (chunk * width)
        used = _solve_windows(
            self.AA, self.BB, self.AB, self.ok, starts, width, params.least_chunks, chunk, params.least_power,
            ridge, solved,
        )  # fmt: skip
        return solved[:used]


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _sum_products(A, B, ok_a, ok_b, chunk, widest, ok, AA, BB, AB):  # type: ignore[no-untyped-def]
    """Add the products of A and B (n, 3, 4) to the sums of `JointSums`; the first lag is −widest."""
    lags = 2 * widest + 1
    running = np.zeros((A.shape[0] + 1, TERMS, TERMS))
    for t in range(A.shape[0]):
        for i in range(TERMS):
            for j in range(TERMS):
                running[t + 1, i, j] = running[t, i, j] + (
                    B[t, 0, i] * B[t, 0, j] + B[t, 1, i] * B[t, 1, j] + B[t, 2, i] * B[t, 2, j]
                )
    for c in range(ok.shape[0]):
        start, stop = widest + c * chunk, widest + (c + 1) * chunk
        good = True
        for t in range(start, stop):
            good = good and ok_a[t]
        for t in range(start - widest, stop + widest):
            good = good and ok_b[t]
        ok[c] = good
        if not good:
            continue
        for t in range(start, stop):
            for i in range(TERMS):
                for j in range(TERMS):
                    AA[c, i, j] += A[t, 0, i] * A[t, 0, j] + A[t, 1, i] * A[t, 1, j] + A[t, 2, i] * A[t, 2, j]
        for k in range(lags):
            shift = k - widest
            for i in range(TERMS):
                for j in range(TERMS):
                    BB[c, k, i, j] = running[stop + shift, i, j] - running[start + shift, i, j]
            for t in range(start, stop):
                for i in range(TERMS):
                    a0, a1, a2 = A[t, 0, i], A[t, 1, i], A[t, 2, i]
                    for j in range(TERMS):
                        b0, b1, b2 = B[t + shift, 0, j], B[t + shift, 1, j], B[t + shift, 2, j]
                        AB[c, k, 0, i, j] += a0 * b0 + a1 * b1
                        AB[c, k, 1, i, j] += a1 * b0 - a0 * b1
                        AB[c, k, 2, i, j] += a2 * b2


@inner_njit()
def _solve_six(N, h):  # type: ignore[no-untyped-def]
    """Overwrite h (6,) with N⁻¹ h by Cholesky; N (6, 6) positive definite is overwritten."""
    for j in range(6):
        for k in range(j):
            for i in range(j, 6):
                N[i, j] -= N[i, k] * N[j, k]
        root = np.sqrt(max(N[j, j], 1e-30))
        for i in range(j, 6):
            N[i, j] /= root
    for i in range(6):
        for k in range(i):
            h[i] -= N[i, k] * h[k]
        h[i] /= N[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            h[i] -= N[k, i] * h[k]
        h[i] /= N[i, i]


@inner_njit()
def _fit_places(AA, BB, AB, ridge, turn, N, r):  # type: ignore[no-untyped-def]
    """Fit positions r (6,) and turn of one window at one lag, from an initial turn; returns misfit² and
    turn.
    """
    cost = 1e300
    for _ in range(12):
        c, s = np.cos(turn), np.sin(turn)
        for i in range(3):
            r[i] = -AA[i, 3] + c * AB[0, i, 3] + s * AB[1, i, 3] + AB[2, i, 3]
            r[3 + i] = -BB[i, 3] + c * AB[0, 3, i] + s * AB[1, 3, i] + AB[2, 3, i]
            for j in range(3):
                N[i, j], N[3 + i, 3 + j] = AA[i, j], BB[i, j]
                N[3 + j, i] = -(c * AB[0, i, j] + s * AB[1, i, j] + AB[2, i, j])
        for i in range(6):
            N[i, i] += ridge
        _solve_six(N, r)
        along = lateral = upright = own = second = 0.0
        for i in range(4):
            a = r[i] if i < 3 else 1.0
            b = r[3 + i] if i < 3 else 1.0
            for j in range(4):
                a2 = r[j] if j < 3 else 1.0
                b2 = r[3 + j] if j < 3 else 1.0
                along += a * AB[0, i, j] * b2
                lateral += a * AB[1, i, j] * b2
                upright += a * AB[2, i, j] * b2
                own += a * AA[i, j] * a2
                second += b * BB[i, j] * b2
        turn = np.arctan2(lateral, along)
        new = own + second - 2.0 * (np.sqrt(along * along + lateral * lateral) + upright)
        for i in range(6):
            new += ridge * r[i] * r[i]
        if cost - new < 1e-7 * new:
            cost = min(cost, new)
            break
        cost = new
    return cost, turn


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _solve_windows(AA, BB, AB, ok, starts, width, least, chunk, least_power, ridge, solved):  # type: ignore[no-untyped-def]
    """Write middle (chunks), lag (samples), certain, residual, positions of each window; returns their
    number.
    """
    lags = BB.shape[1]
    mid = lags // 2
    wa = np.empty((TERMS, TERMS))
    wb, wab = np.empty((lags, TERMS, TERMS)), np.empty((lags, 3, TERMS, TERMS))
    N, trial = np.zeros((6, 6)), np.empty(6)
    cost, places = np.empty(lags), np.empty((lags, 6))
    used, warm = 0, 0.0
    for first in starts:
        whole = 0
        wa[:] = 0.0
        wb[:] = 0.0
        wab[:] = 0.0
        for c in range(first, first + width):
            if ok[c]:
                whole += 1
                wa += AA[c]
                wb += BB[c]
                wab += AB[c]
        if whole < least:
            continue
        samples = whole * chunk
        wa /= samples
        wb /= samples
        wab /= samples
        size = np.sqrt(min(wa[3, 3], wb[mid, 3, 3]))
        if size < least_power:
            continue
        start, best = warm, 1e300
        for k in (mid // 2, mid, mid + mid // 2):
            for i in range(6):
                j, turn = _fit_places(wa, wb[k], wab[k], ridge, warm + i * np.pi / 3.0, N, trial)
                if j < best:
                    best, start = j, turn
        warm = start
        least_lag = 0
        for k in range(lags):
            cost[k], _ = _fit_places(wa, wb[k], wab[k], ridge, start, N, places[k])
            if cost[k] < cost[least_lag]:
                least_lag = k
        inside = 0 < least_lag < lags - 1
        shift = 0.0
        if inside:
            shift = (
                0.5
                * (cost[least_lag - 1] - cost[least_lag + 1])
                / (cost[least_lag - 1] - 2.0 * cost[least_lag] + cost[least_lag + 1])
            )
        solved[used, 0] = first + 0.5 * width
        solved[used, 1] = least_lag - mid + shift
        solved[used, 2] = inside
        solved[used, 3] = np.sqrt(max(cost[least_lag], 0.0)) / size
        for i in range(6):
            solved[used, 4 + i] = places[least_lag, i]
        solved[used, 10] = start
        used += 1
    return used
