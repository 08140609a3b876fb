"""Fixed-interval smoother of the ErKF: modified Bryson–Frazier with checkpoints.

Bierman 1973, "Fixed interval smoothing with discrete measurements": the adjoint λ goes back through the very
blocks of the forward pass, so no covariance is inverted, and x^s = x ⊞ G(−P λ) (G the reset of the last
correction). Only one state per segment is kept; a segment is filtered again, recorded, and swept back. The
result does not depend on the segment length, to the bit. It equals the Rauch–Tung–Striebel smoother at a
hundredth of its memory (docs/science/erkf.md, "Smoother").
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from core.body.erkf.filter import ErkfInputs, ErkfState, ErkfTrack, filter_block, new_record, run_block
from core.body.erkf.kernel import smooth_backward
from core.body.erkf.params import ErkfParams
from core.body.tree import ImuTree
from core.errors import ParameterError
from core.rotation import rotate

SEGMENT = 128
"""Samples per segment: about where checkpoints and record of a ten-minute recording take equally much."""


def smooth(
    state: ErkfState, inputs: ErkfInputs, tree: ImuTree, params: ErkfParams, segment: int = SEGMENT
) -> tuple[ErkfTrack, ErkfState]:
    """Filter a whole recording and smooth it.

    Parameters
    ----------
    segment : samples between checkpoints, ≥ 2; changes memory, not the result.

    Returns
    -------
    The smoothed track and the filter's state after the last sample. `heading_sd` and `refused` are the
    filter's, `joint_residual` is that of the smoothed states.

    Raises
    ------
    EstimationError `filter_diverged` as in `filter_block`.
    """
    if segment < 2:
        raise ParameterError("segment_range", f"Segments of {segment} samples; at least 2.")
    T, n = inputs.valid.shape
    starts = list(range(0, T, segment))
    checkpoints = []
    final = state
    # the covariances of all checkpoints are most of the memory: half of each says it all
    half = np.tril_indices(n * params.states)
    for a in starts:
        checkpoints.append(replace(final, P=final.P[half]))
        _, final = filter_block(final, inputs.part(a, a + segment), tree, params)
    nominal, sd = np.empty((T, n, 16)), np.empty((T, n))
    residual, refused = np.empty((T, len(tree.joints))), np.empty((T, n), bool)
    record = new_record(tree, params, segment)
    lam = np.zeros(n * params.states)
    for a in reversed(starts):
        part, kept, P = inputs.part(a, a + segment), checkpoints.pop(), np.empty_like(state.P)
        P[half] = P.T[half] = kept.P
        track, _ = run_block(replace(kept, P=P), part, tree, params, record)
        smooth_backward(lam, np.ascontiguousarray(part.step_s), record, params.states, track.nominal)
        b = a + len(part.step_s)
        nominal[a:b], sd[a:b], refused[a:b] = track.nominal, track.heading_sd, track.refused
        for k, joint in enumerate(tree.joints):
            i, j, x = joint.proximal, joint.distal, track.nominal
            apart = x[:, i, 0:3] - x[:, j, 0:3]
            apart = apart + rotate(x[:, i, 6:10], joint.r_proximal) - rotate(x[:, j, 6:10], joint.r_distal)
            residual[a:b, k] = np.linalg.norm(apart, axis=1)
    return ErkfTrack(nominal, sd, residual, refused), final
