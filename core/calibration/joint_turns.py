"""Relative heading of the two sensors at a joint, from the acceleration of the joint centre.

Both sensors observe the acceleration of one point, each in its own rest frame; the rotation that aligns the
two is the difference of their forward axes, because in standing both segments face forward
(docs/science/calibration.md, "Forward by likelihood").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import hypot, radians
from typing import Final

import numpy as np

from sagittal.core.agreement.joints import LEG_JOINTS, JointKind, list_worn_joints
from sagittal.core.agreement.params import JointSumParams
from sagittal.core.agreement.terms import find_thinning, find_usable, low_pass_terms, take_mean_out
from sagittal.core.agreement.windows import JointSums
from sagittal.core.calibration.forward import JointMeasure
from sagittal.core.calibration.heading import Part
from sagittal.core.frames import Bools, Floats, Segment
from sagittal.core.rotation import wrap_angle
from sagittal.core.signals.recording import UniformRecording

LEAST_CHUNKS: Final = 3
"""Seconds of walking with both sensors from which a joint is asked."""


@dataclass(frozen=True)
class JointTurnParams:
    """Reliability of the relative heading at a joint (docs/science/calibration.md, "Forward by likelihood").

    Parameters
    ----------
    sd : rad, without drift. doubt : probability of being completely wrong. worst_misfit : of the joint
    acceleration relative to its magnitude; above it the joint is ignored. joints : comparison of
    accelerations.
    """

    sd: Mapping[JointKind, float] = field(
        default_factory=lambda: {"ankle": radians(3.0), "knee": radians(4.0), "hip": radians(8.0)}
    )
    doubt: float = 0.05
    worst_misfit: float = 0.9
    joints: JointSumParams = field(default_factory=JointSumParams)


def measure_joint_turns(
    recording: UniformRecording,
    biases: Mapping[Segment, Floats],
    q: Mapping[Segment, Floats],
    parts: Sequence[Part],
    params: JointTurnParams,
) -> list[JointMeasure]:
    """Relative heading at every joint with two calibrated sensors, over the straight parts.

    Parameters
    ----------
    biases : segment → (3,) rad/s. q : segment → (n, 4) sensor to its rest frame.
    """
    instrumented = list_worn_joints(q)
    if not instrumented or not parts:
        return []
    rate, thin = recording.rate_hz, find_thinning(recording.rate_hz, params.joints)
    start, stop = min(a for a, _ in parts), max(b for _, b in parts)
    walked = np.zeros(len(recording.t_s), np.bool_)
    for a, b in parts:
        walked[a:b] = True
    terms: dict[Segment, Floats] = {}
    usable: dict[Segment, Bools] = {}
    for segment in {s for joint in instrumented for s in joint}:
        x = recording.sensors[segment]
        gyr = x.gyr[start:stop] - biases[segment]
        slow, _ = low_pass_terms(
            q[segment][None, start:stop], x.acc[None, start:stop], gyr[None], rate, params.joints
        )
        terms[segment] = take_mean_out(slow, rate / thin, params.joints)[0]
        usable_mask = find_usable(x.valid[start:stop, None], rate)[0] & walked[start:stop]
        usable[segment] = usable_mask[::thin]
    chunk = round(params.joints.chunk_s * rate / thin)
    measures = (_measure(joint, terms, usable, chunk, params) for joint in instrumented)
    return [x for x in measures if x is not None]


def _measure(
    joint: tuple[Segment, Segment],
    terms: Mapping[Segment, Floats],
    usable: Mapping[Segment, Bools],
    chunk: int,
    params: JointTurnParams,
) -> JointMeasure | None:
    """One joint; None if the fit is poor or the joint hardly moved."""
    first, second = joint
    chunks = len(terms[first]) // chunk
    if not chunks:
        return None
    n = chunks * chunk
    sums = JointSums.empty(chunks, 0)
    sums.add(slice(None), terms[first][:n], terms[second][:n], usable[first][:n], usable[second][:n], chunk)
    whole = replace(params.joints, window_chunks=chunks, least_chunks=LEAST_CHUNKS)
    solved = sums.solve(np.zeros(1, np.int64), chunk, whole)
    if not len(solved) or solved[0, 3] > params.worst_misfit:
        return None
    turn = float(solved[0, 10])
    width = params.joints.window_chunks
    starts = np.arange(0, max(0, chunks - width + 1), max(1, width // 2))
    # a heading that drifts while somebody walks had drifted before, since the standing, by as much
    apart = wrap_angle(sums.solve(starts, chunk, params.joints)[:, 10] - turn)
    drift = float(np.sqrt(np.mean(apart**2))) if len(apart) else 0.0
    sd = hypot(params.sd[LEG_JOINTS[joint]], drift)
    return JointMeasure(first, second, float(wrap_angle(turn)), sd, params.doubt)
