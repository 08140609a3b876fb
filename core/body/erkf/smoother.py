"""Fixed-interval smoother of the ErKF: modified Bryson–Frazier with checkpoints.

Bierman 1973, "Fixed interval smoothing with discrete measurements": the adjoint λ goes back through the very
blocks of the forward pass, so no covariance is inverted, and x^s = x ⊞ G(−P λ) (G the reset of the last
correction). −P λ is carried forward without P (Koopman 1993). Only one state per segment is kept; a segment
is filtered again, recorded, and swept back. It equals the Rauch–Tung–Striebel smoother at a hundredth of its
memory (docs/science/erkf.md, "Smoother").
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from core.body.erkf.filter import ErkfInputs, ErkfState, ErkfTrack, memory_of, new_record, prepare_run
from core.body.erkf.kernel import filter_segments, row_length
from core.body.erkf.params import ErkfParams
from core.body.tree import ImuTree
from core.errors import ParameterError

SEGMENT = 128
"""Samples per segment, at least: 21 MB of kept states for ten minutes of seven sensors, and a record of 8 MB.
Longer ones outgrow the processor's cache: with 256 a step takes 8 % longer."""


def smooth(
    state: ErkfState, inputs: ErkfInputs, tree: ImuTree, params: ErkfParams, segment: int | None = None
) -> tuple[ErkfTrack, ErkfState]:
    """Filter a whole recording and smooth it.

    Parameters
    ----------
    segment : samples between the states that are kept, ≥ 2; changes memory, and the result by rounding only.
        None = 128, and for takes above eleven minutes what keeps states and record small together.

    Returns
    -------
    The smoothed track and the filter's state after the last sample. `heading_sd` and `refused` are the
    filter's, `joint_residual` is that of the smoothed states.

    Raises
    ------
    EstimationError `filter_diverged` as in `filter_block`.
    """
    T, n = inputs.valid.shape
    if segment is None:
        segment = max(SEGMENT, math.isqrt(T // 4))
    if segment < 2:
        raise ParameterError("segment_range", f"Segments of {segment} samples; at least 2.")
    run = prepare_run(state, inputs, tree, params, segment)
    kept = np.empty((-(-T // segment), row_length(n, n * params.states)))
    output = tuple(run.output)
    record = tuple(new_record(tree, params, 1))
    broke = filter_segments(*run.arguments(), record, output, kept, segment, False)
    final = run.end(broke)
    again = replace(run, memory=memory_of(final))
    record = tuple(new_record(tree, params, segment))
    filter_segments(*again.arguments(), record, output, kept, segment, True)
    found = run.output
    return ErkfTrack(found.smoothed, found.heading_sd, found.residual, found.refused), final
