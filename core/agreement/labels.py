"""Assignment of sensors to segments from the joints alone: the order in which neighbours share a joint.

From foot to foot via the pelvis seven sensors form one path. All paths are scored whose middle sensor, the
pelvis, rotates least; which end is the left foot follows from the hips (core/agreement/exchange.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import pairwise, permutations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sagittal.core.frames import Segment

PATH: Final[tuple[Segment, ...]] = ("foot_l", "shank_l", "thigh_l", "pelvis", "thigh_r", "shank_r", "foot_r")
MIDDLE: Final = 3


@dataclass(frozen=True)
class SortedLabels:
    """The labels under which the joints fit best.

    Parameters
    ----------
    stated_for : best label → declared label of that sensor. Left and right may be swapped.
    misfit : geometric mean of the joint misfits. stated : for the declared labels. next : for the best path
        of a different order.
    """

    stated_for: Mapping[Segment, Segment]
    misfit: float
    stated: float
    next: float

    @property
    def gain(self) -> float:
        """Sum over the joints of ln(misfit as declared / as sorted)."""
        return (len(PATH) - 1) * float(np.log(self.stated / self.misfit))

    def is_clear(self, exchanged: float, ratio: float, distinct: float) -> bool:
        """Whether it fits better than the declared or swapped labels by a ratio, and than any other order."""
        return exchanged > ratio * self.misfit and self.next > distinct * self.misfit

    def exchange_legs(self) -> dict[Segment, Segment]:
        """The same order with left and right interchanged."""
        return dict(zip(PATH, reversed([self.stated_for[s] for s in PATH]), strict=True))


@cache
def _list_paths() -> NDArray[np.int64]:
    """Every order of seven sensors (2520, 7), one of each pair of reversed orders."""
    return np.array([p for p in permutations(range(len(PATH))) if p[0] < p[-1]], np.int64)


def sort_by_joints(
    misfits: Mapping[frozenset[Segment], float], rates: Mapping[Segment, float], calmest: float
) -> SortedLabels | None:
    """Score every order of seven sensors; None with any other set of sensors.

    Parameters
    ----------
    misfits : of every pair, by declared labels. rates : RMS of the rate of each sensor while walking, rad/s.
        calmest : maximum ratio of the rate of the pelvis to that of the calmest sensor.
    """
    if set(rates) != set(PATH) or any(frozenset(x) not in misfits for x in permutations(PATH, 2)):
        return None
    least = min(rates.values())
    middles = [s for s in PATH if rates[s] <= calmest * least]
    cost = np.array([[0.0 if a == b else np.log(misfits[frozenset((a, b))]) for b in PATH] for a in PATH])
    paths = _list_paths()
    paths = paths[np.isin(paths[:, MIDDLE], [PATH.index(s) for s in middles])]
    scores = cost[paths[:, :-1], paths[:, 1:]].mean(axis=1)
    order = np.argsort(scores)
    best = [PATH[k] for k in paths[order[0]]]
    # the end that was stated as more of the left leg stays the left one: the hips judge that
    if sum(s.endswith("_l") for s in best[:MIDDLE]) < sum(s.endswith("_r") for s in best[:MIDDLE]):
        best.reverse()
    stated = np.mean([cost[PATH.index(a), PATH.index(b)] for a, b in pairwise(PATH)])
    return SortedLabels(
        dict(zip(PATH, best, strict=True)),
        float(np.exp(scores[order[0]])),
        float(np.exp(stated)),
        float(np.exp(scores[order[1]])) if len(order) > 1 else np.inf,
    )
