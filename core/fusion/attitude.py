"""Attitude of one sensor: the explicit complementary filter, six axes, gyro bias already removed.

Mahony, Hamel and Pflimlin 2008 (IEEE TAC 53(5)), eq 32 with k_I = 0: q̇ = ½ q ⊗ (ω + k_P e), e = a × â, where
â = R(q)ᵀ e₃ is the predicted vertical and a the specific force. Two differences, both for walking:
- a is divided by its norm at rest, not by its current norm (docs/science/orientation.md, "Departures from the
  paper"). Over a stride the horizontal acceleration averages to zero; divided by the current norm it does
  not, and biases the vertical.
- the integral term is omitted: without a magnetometer the bias about the vertical is unobservable and
  diverges. The bias is the mean over rest. Heading is only as good as the gyroscope.

Calibration needs tilt to find the walking direction and fusion needs it for the result; both use this filter,
so the module is independent of calibration.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np

from sagittal.core.errors import EstimationError, ParameterError
from sagittal.core.frames import Bools, Floats
from sagittal.core.message import Message
from sagittal.core.rotation import compiled, find_middle
from sagittal.core.signals.held_samples import SampleSeries, cut_blocks


@dataclass(frozen=True)
class AttitudeParams:
    """Gain and gate.

    Parameters
    ----------
    kp : 1/s; a tilt error decays with time constant 1/kp. 0.1 is untuned
        (docs/science/orientation.md, "Parameters").
    relearn_s : shortest gap after which the tilt is estimated again; up to 0.1 s are interpolated upstream
        (docs/science/timeline.md, "Rule") and do not occur here.
    """

    kp: float = 0.1
    relearn_s: float = 0.1

    def __post_init__(self) -> None:
        if not 0.0 <= self.kp <= 10.0:
            raise ParameterError(
                "gain_out_of_range", Message("kp = {kp:g} 1/s is outside 0 to 10.", kp=self.kp)
            )


@dataclass(frozen=True, eq=False)
class AttitudeState:
    """Filter state carried from one sample to the next.

    Parameters
    ----------
    q : (4,) sensor to world. rate : (3,) rad/s of the last sample. age_s : time since the tilt was lost, inf
        if known. lost_s : length of the current gap.
    """

    q: Floats
    rate: Floats
    age_s: float = np.inf
    lost_s: float = 0.0


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def attitude_kernel(
    gyr: Floats,
    acc: Floats,
    valid: Bools,
    dt: float,
    rest_norm: float,
    kp: float,
    relearn_s: float,
    x: Floats,
    out: Floats,
) -> None:
    """Advance the state x = (q, rate, age, lost) over a block and write q (n, 4)."""
    w, i, j, k = x[0], x[1], x[2], x[3]
    rx, ry, rz = x[4], x[5], x[6]
    age, lost = x[7], x[8]
    for n in range(gyr.shape[0]):
        if not valid[n]:
            # a held rate would spin the segment on for the whole gap: the orientation is held instead
            lost += dt
            rx, ry, rz = 0.0, 0.0, 0.0
            out[n, 0], out[n, 1], out[n, 2], out[n, 3] = w, i, j, k
            continue
        if lost > 0.0:
            if lost > relearn_s:
                age = 0.0
            lost = 0.0
            rx, ry, rz = gyr[n, 0], gyr[n, 1], gyr[n, 2]
        # the mean of two samples is the rate between them, forwards and backwards alike
        half = 0.25 * dt
        px, py, pz = half * (rx + gyr[n, 0]), half * (ry + gyr[n, 1]), half * (rz + gyr[n, 2])
        rx, ry, rz = gyr[n, 0], gyr[n, 1], gyr[n, 2]
        square = px * px + py * py + pz * pz
        if square < 0.01:
            # series of sin(p)/p and cos(p) for half a turn angle p < 0.1 rad: exact to 3e-14
            s = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0 * (1.0 - square / 72.0)))
            c = 1.0 - square / 2.0 * (1.0 - square / 12.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0)))
        else:
            p = np.sqrt(square)
            s, c = np.sin(p) / p, np.cos(p)
        w, i, j, k = compiled.multiply(w, i, j, k, c, s * px, s * py, s * pz)
        gain = kp
        if age < np.inf:
            age += dt
            if age * kp < 1.0:
                gain = 1.0 / age
            else:
                age = np.inf
        ax, ay, az = acc[n, 0], acc[n, 1], acc[n, 2]
        # e = a × â turns the estimated vertical â towards the measured a
        g = 0.5 * dt * gain / rest_norm
        vx = 2.0 * (i * k - w * j)
        vy = 2.0 * (j * k + w * i)
        vz = w * w - i * i - j * j + k * k
        ex, ey, ez = g * (ay * vz - az * vy), g * (az * vx - ax * vz), g * (ax * vy - ay * vx)
        w, i, j, k = compiled.multiply(w, i, j, k, 1.0, ex, ey, ez)
        r = 1.0 / np.sqrt(w * w + i * i + j * j + k * k)
        w, i, j, k = w * r, i * r, j * r, k * r
        out[n, 0], out[n, 1], out[n, 2], out[n, 3] = w, i, j, k
    x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8] = w, i, j, k, rx, ry, rz, age, lost


def advance(
    state: AttitudeState,
    gyr: Floats,
    acc: Floats,
    valid: Bools,
    rate_hz: float,
    rest_norm: float,
    params: AttitudeParams,
) -> tuple[Floats, AttitudeState]:
    """Run the filter over a block of samples.

    Parameters
    ----------
    gyr, acc : (n, 3) rad/s with the bias removed, m/s². valid : (n,).

    Returns
    -------
    q (n, 4) sensor to world after each sample, and the final state. Results are bit-identical for any
    division into blocks.

    Raises
    ------
    EstimationError `filter_diverged` if a valid sample is not finite.
    """
    gyr, acc = np.ascontiguousarray(gyr, np.float64), np.ascontiguousarray(acc, np.float64)
    x = np.array([*state.q, *state.rate, state.age_s, state.lost_s], np.float64)
    out = np.empty((len(gyr), 4))
    attitude_kernel(
        gyr, acc, np.ascontiguousarray(valid), 1.0 / rate_hz, rest_norm, params.kp, params.relearn_s, x, out
    )
    if not np.isfinite(x[:7]).all():
        raise EstimationError(
            "filter_diverged",
            "The orientation filter met a sample that is not a number; mark it invalid or interpolate it.",
        )
    return out, AttitudeState(x[:4].copy(), x[4:7].copy(), float(x[7]), float(x[8]))


@dataclass(frozen=True, eq=False)
class _Runs:
    """The filter over parts of a recording, in both directions; parameters as in `estimate_orientation`."""

    gyr: SampleSeries
    acc: SampleSeries
    valid: Bools
    rate_hz: float
    rest_norm: float
    params: AttitudeParams

    def run(
        self, q0: Floats, first: int, last: int, age_s: float = np.inf, out: Floats | None = None
    ) -> Floats:
        """Orientation at sample `last` from that at `first`; all in between, in ascending order, written
        to `out`.
        """
        step, low = (1, first) if last >= first else (-1, last)
        state = AttitudeState(q0, step * self.gyr[first : first + 1][0], age_s)
        if out is not None:
            out[first - low] = q0
        for block in list(cut_blocks(abs(last - first)))[::step]:
            # of the samples without the first one
            start = low + (step == 1)
            part = slice(start + block.start, start + block.stop)
            rate, force = step * self.gyr[part][::step], self.acc[part][::step]
            q, state = advance(
                state, rate, force, self.valid[part][::step], self.rate_hz, self.rest_norm, self.params
            )
            if out is not None:
                out[part.start - low : part.stop - low] = q[::step]
        return state.q

    def smooth(self, into: Floats, q0: Floats, start: int, a: int, b: int, age_s: float = np.inf) -> None:
        """Write smoothed orientations of the samples a to b, inclusive, from q0 at one of them."""
        at_end = start == b and start != a
        first = self.run(q0, b, a, age_s) if at_end else self.run(self.run(q0, start, b, age_s), b, a)
        last = self.run(first, a, b, out=into)
        backward = np.empty_like(into)
        self.run(last, b, a, out=backward)
        for part in cut_blocks(len(into)):
            into[part] = find_middle(backward[part], into[part])


def estimate_orientation(
    q_rest: Floats,
    start_sample: int,
    gyr: SampleSeries,
    acc: SampleSeries,
    valid: Bools,
    rate_hz: float,
    rest_norm: float,
    params: AttitudeParams,
) -> Floats:
    """Orientation (n, 4) of a whole recording from a known orientation at sample `start_sample`, without
    phase lag.

    The filter runs to the end, back to the start and forward again; the result is halfway between the last
    backward and the last forward run. Backward the rates are negated and the order reversed, which with the
    mean of two samples as rate is exactly the inverse motion: the two runs differ only in the corrections by
    the accelerometer, and its lag cancels. After a gap the filter starts with the orientation from before it,
    estimates its tilt in the first run, and has an unknown heading (core/fusion/drift.py). Inside a gap the
    orientation is held.

    Parameters
    ----------
    gyr, acc : (n, 3) as in `advance`, accessed in blocks.
    """
    runs = _Runs(gyr, acc, valid, rate_hz, rest_norm, params)
    out = np.empty((len(valid), 4))
    stretches = _stretches(valid, round(params.relearn_s * rate_hz))
    if not stretches:
        out[:] = q_rest
        return out
    home = min(
        range(len(stretches)),
        key=lambda k: max(stretches[k][0] - start_sample, start_sample - stretches[k][1], 0),
    )
    a, b = stretches[home]
    runs.smooth(out[a : b + 1], q_rest, min(max(start_sample, a), b), a, b)
    out[:a], out[b + 1 :] = out[a], out[b]
    for a, b in stretches[home + 1 :]:
        runs.smooth(out[a : b + 1], out[a - 1].copy(), a, a, b, 0.0)
        out[b + 1 :] = out[b]
    for a, b in reversed(stretches[:home]):
        runs.smooth(out[a : b + 1], out[b + 1].copy(), b, a, b, 0.0)
        out[:a] = out[a]
    return out


def _stretches(valid: Bools, bridge: int) -> list[tuple[int, int]]:
    """First and last index of the valid stretches; gaps of up to `bridge` samples do not separate them."""
    index = np.flatnonzero(valid)
    if not len(index):
        return []
    cuts = np.flatnonzero(np.diff(index) - 1 > bridge)
    firsts = index[np.concatenate(([0], cuts + 1))]
    lasts = index[np.concatenate((cuts, [len(index) - 1]))]
    return [(int(a), int(b)) for a, b in zip(firsts, lasts, strict=True)]


def compile_attitude_kernel() -> None:
    """Compile the kernel or load it from the cache, so that the first recording is not delayed."""
    state = AttitudeState(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3))
    up = np.tile([0.0, 0.0, 9.81], (2, 1))
    advance(state, np.zeros((2, 3)), up, np.ones(2, bool), 100.0, 9.81, AttitudeParams())
