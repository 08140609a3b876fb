"""Fixed-interval smoother of the ErKF: modified Bryson–Frazier with checkpoints.

Bierman 1973, "Fixed interval smoothing with discrete measurements": the adjoint λ is propagated backward
through the same blocks as the forward pass, so no covariance is inverted, and x^s = x ⊞ G(−P λ) (G the reset
of the last correction). −P λ is propagated forward without P (Koopman 1993). Only one state per segment is
stored; a segment is filtered again, recorded, and swept backward. The result equals that of the
Rauch–Tung–Striebel smoother at a hundredth of its memory (docs/science/erkf.md, "Smoother").
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from sagittal.core.body.erkf.filter import (
    ErkfInputs,
    ErkfState,
    ErkfTrack,
    TakeInputs,
    new_record,
    prepare_run,
)
from sagittal.core.body.erkf.kernel import filter_segments, row_length
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.tree import ImuTree
from sagittal.core.errors import ParameterError
from sagittal.core.message import Message
from sagittal.core.signals.memory import make_pages

SEGMENT = 128
"""Samples per segment, at least: 21 MB of kept states for ten minutes of seven sensors, and a record of 8 MB.
Longer ones outgrow the processor's cache: with 256 a step takes 8 % longer."""

AT_ONCE: Final = 1 << 12
"""Samples, about, that are laid side by side for the filter: 1.4 MB of seven sensors."""


def do_nothing() -> None:
    """Default callback: does nothing."""


def smooth(
    state: ErkfState,
    inputs: ErkfInputs | TakeInputs,
    tree: ImuTree,
    params: ErkfParams,
    segment: int | None = None,
    filtered: Callable[[], None] = do_nothing,
) -> tuple[ErkfTrack, ErkfState]:
    """Filter a whole recording and smooth it.

    Parameters
    ----------
    segment : samples between stored states, ≥ 2; affects memory, and the result only by rounding. None = 128,
        and for recordings longer than eleven minutes the value that minimises the size of states and record
        together.
    filtered : called after the filter has finished, before large arrays are allocated; no errors are raised
        afterwards.

    Returns
    -------
    The smoothed track and the filter's state after the last sample. `heading_sd` and `refused` are from the
    filter, `joint_residual` from the smoothed states.

    Raises
    ------
    EstimationError `filter_diverged` as in `filter_block`.
    """
    signals = inputs.known if isinstance(inputs, TakeInputs) else inputs
    T, n = signals.valid.shape
    if segment is None:
        segment = max(SEGMENT, math.isqrt(T // 4))
    if segment < 2:
        raise ParameterError(
            "segment_range", Message("Segments of {segment} samples; at least 2.", segment=segment)
        )
    whole, N = -(-T // segment), n * params.states
    at_once = max(1, AT_ONCE // segment)
    blocks = [(first, min(first + at_once, whole)) for first in range(0, whole, at_once)]
    record, lam, final = tuple(new_record(tree, params, 1)), np.zeros(N), state
    checkpoints = []
    for first, past in blocks:
        run = prepare_run(final, inputs.part(first * segment, past * segment), tree, params, segment)
        # each block's go while the smoothed states grow
        checkpoints.append(make_pages(past - first, row_length(n, N)))
        broke = filter_segments(
            *run.arguments(), record, tuple(run.output), checkpoints[-1], segment, False, lam
        )
        final = run.end(broke, float(signals.step_s[: first * segment].sum()))
    filtered()
    places, turns = (tuple(np.empty((T, k)) for _ in range(n)) for k in (3, 4))
    residual, refused = np.empty((T, len(tree.joints))), np.empty((T, n), np.bool_)
    heading_sd = np.empty((0, n))
    record = tuple(new_record(tree, params, segment))
    for first, past in reversed(blocks):
        part = slice(first * segment, past * segment)
        run = prepare_run(final, inputs.part(part.start, part.stop), tree, params, segment)
        buffers = run.output
        filter_segments(*run.arguments(), record, tuple(buffers), checkpoints.pop(), segment, True, lam)
        for i in range(n):
            places[i][part], turns[i][part] = buffers.smoothed[:, i, :3], buffers.smoothed[:, i, 3:]
        residual[part], refused[part] = buffers.residual, buffers.refused
        if past == whole:
            heading_sd = buffers.heading_sd[-1:].copy()
    return ErkfTrack(places, turns, heading_sd, residual, refused, np.empty((0, n, 16))), final
