"""Detection of accelerometers with all signs inverted: a mirror image of a movement is consistent with no
joint.

With f → −f up and down are interchanged: after levelling, heights and one horizontal direction of every
position change sign, and the specific force is mirrored. No rotation does that, so neighbouring sensors
disagree.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Final

import numpy as np

from sagittal.core.agreement.params import ExchangeParams, JointParams
from sagittal.core.agreement.terms import TermsPart
from sagittal.core.agreement.windows import compare_at_joint
from sagittal.core.frames import Floats, Segment

MOST: Final = 3
"""So many sensors of seven are looked for: more would be the majority."""

LEVEL_AGAIN: Final[Floats] = np.array([1.0, -1.0, -1.0])


def turn_round(terms: TermsPart) -> TermsPart:
    """The terms of the same sensor for −f, levelled again by half a turn about a horizontal axis."""
    M = terms.M * LEVEL_AGAIN[:, None]
    M[:, :, 3] *= -1.0
    return replace(terms, M=np.ascontiguousarray(M))


def find_mirrored(
    terms: Mapping[Segment, TermsPart],
    misfits: Mapping[frozenset[Segment], float],
    joints: Sequence[tuple[Segment, Segment]],
    joint_params: JointParams,
    params: ExchangeParams,
) -> tuple[frozenset[Segment], float]:
    """Sensors that fit their neighbours only with −f, and the gain as the sum of ln(misfit as declared /
    inverted).

    Parameters
    ----------
    misfits : of the joints as declared.
    """
    gains: dict[frozenset[Segment], float] = {}
    bad: set[frozenset[Segment]] = set()
    for a, b in joints:
        inverted = compare_at_joint((a, b), terms[a], turn_round(terms[b]), joint_params)
        as_stated = misfits.get(frozenset((a, b)))
        if as_stated is not None and len(inverted.t_s):
            misfit = float(np.median(inverted.residual))
            gains[frozenset((a, b))] = float(np.log(as_stated / misfit))
            bad |= {frozenset((a, b))} if misfit > params.worst_residual else set()
    segments = sorted({s for joint in gains for s in joint})
    most = min(MOST, (len(segments) - 1) // 2)
    gain_by_sensor = {
        frozenset(chosen): sum(gain for joint, gain in gains.items() if len(joint & set(chosen)) == 1)
        for k in range(1, most + 1)
        for chosen in combinations(segments, k)
    }
    order = sorted(gain_by_sensor, key=lambda s: gain_by_sensor[s], reverse=True)
    if not order or gain_by_sensor[order[0]] < np.log(params.mirrored):
        return frozenset(), 0.0
    if any(len(joint & order[0]) == 1 for joint in bad):
        return frozenset(), 0.0
    if len(order) > 1 and gain_by_sensor[order[0]] - gain_by_sensor[order[1]] < np.log(params.distinct):
        return frozenset(), 0.0
    return order[0], gain_by_sensor[order[0]]
