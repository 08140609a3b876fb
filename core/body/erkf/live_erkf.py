"""The ErKF in real time: the offline kernel on incoming samples, without its per-call checks.

Live parameters: nine states, joint centres known to 3 cm as for all people, and zero velocities weighted
according to the limits of a trailing rule. On seven simulated people, neura_walk and gaitmap_foot: flexion
angles within 0.7° and stride lengths within 1 % of the truth; with joint centres of 1 cm the angles are 0.3
to 0.5° worse.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from math import radians
from typing import Any, Final, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from sagittal.core.body.erkf.filter import ErkfInputs, links_of, memory_of, new_output, new_record, noise_of
from sagittal.core.body.erkf.gaps import HOLD_S
from sagittal.core.body.erkf.kernel import (
    CONTACT,
    INVALID,
    NONE_KEPT,
    PATCHED,
    STILL,
    ErkfOutput,
    filter_segments,
)
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.start import start_state
from sagittal.core.body.live_still import ROLLING_MPS
from sagittal.core.body.tree import ImuTree
from sagittal.core.frames import Bools, Floats
from sagittal.core.fusion.live_rest import LOST_TILT, RestLooks
from sagittal.core.rotation import exp, multiply, rotate

HEADING_SD: Final = radians(2.0)
"""Of each segment's heading while standing, where forward axes were made to agree with the joints on the walk
before (core/body/erkf/headings.py): they face ahead then, by calibration. Anything from 0.5° to 2° is alike;
with the 30° of a start that knows nothing the filter turns them again, and the angles' zero of standing with
them: 1.4° of knee rotation on neura_walk, nothing else. The smoothed headings of the calibration walk are no
better start."""


UP: Final = np.array([0.0, 0.0, 1.0])

SETTLED_TILT: Final = radians(3.0)
"""Of gravity in one sample of a foot that stands: the rule's 1.2 m/s² would be 7°, a foot's rest has less."""


CENTRE_SD_M: Final = 0.03
"""Less than of files (`ErkfParams.people`): with 0.058 m live flexion of neura_walk is 0.1 to 0.3° worse and
strides of simulated people 8 to 17 mm short instead of 6 short to 8 long."""


def live_params() -> ErkfParams:
    """The live parameters."""
    return replace(
        ErkfParams.live(),
        joint_centre_sd=CENTRE_SD_M,
        zero_velocity_sd=ROLLING_MPS,
    )


class SignalBlock(NamedTuple):
    """A block of filter inputs: acc, gyr (T, n, 3) corrected and bridged, valid (T, n), still (T, n, 2)
    from `StillnessDetector`, patched (T, n) as in `ErkfInputs`.
    """

    acc: Floats
    gyr: Floats
    valid: Bools
    still: Bools
    patched: Bools

    def part(self, first: int, past: int) -> SignalBlock:
        """Samples first … past − 1."""
        k = slice(first, past)
        return SignalBlock(self.acc[k], self.gyr[k], self.valid[k], self.still[k], self.patched[k])


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def _flag(valid, still, patched, foot, flags):  # type: ignore[no-untyped-def]
    """Write the kernel's flags (T, n) for measured, foot in contact, and rest."""
    for k in range(valid.shape[0]):
        for i in range(valid.shape[1]):
            flags[k, i] = 0 if valid[k, i] else INVALID
            if foot[i] and still[k, i, 0]:
                flags[k, i] |= CONTACT
            if still[k, i, 1]:
                flags[k, i] |= STILL
            if patched[k, i]:
                flags[k, i] |= PATCHED


class LiveErkf:
    """The filter of one tree; results are bit-identical for any division into blocks.

    `broken` after its covariance has lost positive definiteness: units, positions or the order of the sensors
    are wrong, and it does not recover.

    Parameters
    ----------
    standing : first block, quiet standing throughout. q : (n, 4) sensor orientations at its start.
    """

    def __init__(
        self, tree: ImuTree, params: ErkfParams, rate_hz: float, standing: SignalBlock, q: Floats
    ) -> None:
        T, n = standing.valid.shape
        self.tree = tree
        self._dt, self._first = 1.0 / rate_hz, True
        self._foot = np.zeros(n, np.bool_)
        self._foot[list(tree.feet)] = True
        self._noise = noise_of(params, rate_hz)
        none = np.zeros((T, n), np.bool_)
        step = self._step = np.full(T, self._dt)
        state = start_state(
            tree, ErkfInputs(step, standing.acc, standing.gyr, standing.valid, none, none), params, (0, T), q
        )
        self._memory = memory_of(state)
        record = new_record(tree, params, 1)
        self._given = tuple(self._memory), tuple(links_of(tree, params)), tuple(self._noise), tuple(record)
        self._lam = np.zeros(len(self._memory.P))
        self._heading, self._rolling = np.empty((0, n)), np.empty((0, n))
        self._gone, self._adrift = np.zeros(n, np.int64), np.zeros(n, np.bool_)
        linked = {i for j in tree.joints for i in (j.proximal, j.distal)}
        self._alone = frozenset(tree.feet) - linked
        self._looked_at = RestLooks(n, rate_hz)
        self._hold, self._params = round(HOLD_S * rate_hz), params
        self.broken = False

    def push(self, signals: SignalBlock) -> tuple[Floats, Floats]:
        """States (T, n, 16) and distances (T, joints) of the ends of each joint; NaN once it is `broken`.

        Also NaN: a foot after a long data loss until its next rest, and one sample of a foot that is
        reinitialised because its rest contradicts its path, so that no distance spans the discontinuity.
        """
        T, n = signals.valid.shape
        output = new_output(self.tree, T)
        states, residual = output.nominal, output.residual
        if self.broken:
            states[:], residual[:] = np.nan, np.nan
            return states, residual
        if len(self._step) != T:
            self._step = np.full(T, self._dt)
        step = self._step
        if self._first and T:
            step, self._first = step.copy(), False
            step[0] = 0.0
        flags = np.empty((T, n), np.uint8)
        _flag(signals.valid, signals.still, signals.patched, self._foot, flags)
        samples = (step, signals.acc, signals.gyr, flags, self._heading, self._rolling)
        looks = list(self._looks(signals))
        whole = signals.valid.all() and not self._gone.any() and not self._adrift.any()
        if whole and not looks:
            self._filter(samples, output)
            return states, residual
        adrift = np.zeros((T, n), np.bool_)
        begins = [] if whole else list(self._settles(signals, adrift))
        for first, past in pairwise(sorted({0, T, *(k for k, _ in begins), *(k + 1 for k, _ in looks)})):
            for _, i in (x for x in begins if x[0] == first):
                self._settle(i, signals.acc[first, i], signals.gyr[first, i])
            part = (*(x[first:past] for x in samples[:4]), *samples[4:])
            self._filter(part, output.part(first, past))
            if self.broken:
                states[past:], residual[past:] = np.nan, np.nan
                break
            for k, i in (x for x in looks if x[0] == past - 1):
                if _tilt(states[k, i, 6:10], signals.acc[k, i]) > LOST_TILT:
                    self._settle(i, signals.acc[k, i], signals.gyr[k, i])
                    adrift[k, i] = True
        states[adrift] = np.nan
        return states, residual

    def _filter(self, samples: tuple[NDArray[Any], ...], output: ErkfOutput) -> None:
        """Filter some samples; NaN from the point where the covariance fails."""
        memory, links, noise, record = self._given
        broke = filter_segments(
            memory, samples, links, noise, record, tuple(output), NONE_KEPT, 0, False, self._lam
        )
        if broke >= 0:
            output.nominal[broke:], output.residual[broke:], self.broken = np.nan, np.nan, True

    def _settles(self, signals: SignalBlock, adrift: Bools) -> Iterator[tuple[int, int]]:
        """Yield sample and sensor for each unlinked foot that rests again after a loss; marks all feet until
        they do.

        A foot lost in mid-swing keeps rotating by up to a right angle while its last rate is held. The joints
        correct it within a second, with errors of up to 50° until then; an unlinked foot is corrected only at
        its next rest, which took the filter alone half a minute.
        """
        for k in range(len(adrift)):
            for i in self.tree.feet:
                self._gone[i] = 0 if signals.valid[k, i] else self._gone[i] + 1
                if self._gone[i] > self._hold:
                    self._adrift[i] = True
                elif self._adrift[i] and signals.still[k, i, 0]:
                    self._adrift[i] = False
                    if i in self._alone:
                        yield k, i
            adrift[k] = self._adrift

    def _looks(self, signals: SignalBlock) -> Iterator[tuple[int, int]]:
        """Yield sample and sensor for each unlinked foot that has rested long enough to be checked."""
        look = self._looked_at.push(signals.still[:, :, 0])
        yield from ((k, i) for k, i in np.argwhere(look).tolist() if i in self._alone)

    def _settle(self, i: int, acc: Floats, gyr: Floats) -> None:
        """Reinitialise sensor i at its current position, at rest: levelled by gravity, heading unchanged."""
        memory, m, c = self._memory, self._noise.m, self._params
        x = memory.x[i]
        x[3:6] = 0.0
        force = rotate(x[6:10], acc)
        force /= np.linalg.norm(force)
        axis = np.cross(force, UP)
        sine = float(np.linalg.norm(axis))
        turn = axis * (np.arctan2(sine, force[2]) / sine) if sine > 0.0 else np.zeros(3)
        x[6:10] = multiply(exp(turn), x[6:10])
        part = slice(i * m, (i + 1) * m)
        memory.P[part], memory.P[:, part], memory.dx[part] = 0.0, 0.0, 0.0
        sd = np.repeat((c.start_position_sd, ROLLING_MPS, SETTLED_TILT, c.start_gyr_bias_sd,
                        c.start_acc_bias_sd), 3)[:m]  # fmt: skip
        memory.P[part, part] = np.diag(sd**2)
        memory.before[i], memory.refused[i] = np.concatenate((acc, gyr)), 0


def _tilt(q: Floats, acc: Floats) -> float:
    """Angle between the vertical by the sensor's orientation and the specific force measured at rest."""
    force = rotate(q, acc)
    return float(np.arctan2(np.hypot(force[0], force[1]), force[2]))
