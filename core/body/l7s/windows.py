"""L7S over a recording in windows: the filter runs through, positions are estimated window by window.

For a long recording the equations of all nodes do not fit into memory: they take 3 kB per sample.
Measurements influence the positions of a node only within about a minute, so a window solved with a larger
margin on both sides gives the same result in its middle as the whole recording (docs/science/l7s.md, "Both
ways").
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from sagittal.core.body.l7s.filter import L7sInputs, L7sParams, L7sTrack, filter_block, start_l7s_state
from sagittal.core.body.l7s.foot_place import find_sensor_offsets
from sagittal.core.body.l7s.inputs import L7sTake
from sagittal.core.body.l7s.legs import LEGS
from sagittal.core.body.l7s.smoother import NODE_S, find_hop, smooth_track
from sagittal.core.frames import Bools, Floats
from sagittal.core.signals.held_samples import SHORT

WHOLE: Final = SHORT
"""Samples up to which a take is one window, and 200 MB."""

LONG: Final = 1 << 15
"""Samples of a window of a longer take."""

AROUND_S: Final = 120.0
"""What is solved with a window before and after it: the pull to the filter's places fades with some 22 s."""


@dataclass(frozen=True, eq=False)
class PlacedWindow:
    """Consecutive samples with their estimated positions.

    Parameters
    ----------
    first : first sample in the recording. inputs, track : of the filter. R : (n, 3, 3, 3) and
    p : (n, 3, 3) of BODIES in Sy's frames. passes, moved : of `WholeTrack`. P : (27, 27)
    of the filter after it.
    """

    first: int
    inputs: L7sInputs
    track: L7sTrack
    R: Floats
    p: Floats
    passes: int
    moved: float
    P: Floats


def cut_windows(samples: int, rate_hz: float) -> list[tuple[slice, slice]]:
    """Windows of a recording, each as the solved range and the range within it to be used.

    All begin on a node of the recording, so that nodes coincide.
    """
    count = 1 if samples <= WHOLE else -(-samples // LONG)
    hop, around = find_hop(rate_hz), round(AROUND_S / NODE_S) * find_hop(rate_hz)
    edges = [*(samples * i // count // hop * hop for i in range(count)), samples]
    windows = []
    for first, past in pairwise(edges):
        start, stop = max(0, first - around), min(samples, past + around)
        windows.append((slice(start, stop), slice(first - start, past - start)))
    return windows


def place_windows(
    take: L7sTake, valid: Bools | None, rate_hz: float, params: L7sParams
) -> tuple[Floats, Iterator[PlacedWindow]]:
    """Filter a recording and estimate the positions of its bodies.

    Parameters
    ----------
    valid : (n, 3) as in `smooth_track`; None = use the filter's positions.

    Returns
    -------
    `WholeTrack.offsets`, and an iterator over the windows.

    Raises
    ------
    EstimationError as `filter_block` and `smooth_track`, when a window is requested.
    """
    offsets = np.zeros((len(LEGS), 3))
    if valid is not None:
        offsets = find_sensor_offsets(take, valid, take.model, rate_hz)
    return offsets, _windows(take, valid, rate_hz, params, offsets)


def _windows(
    take: L7sTake, valid: Bools | None, rate_hz: float, params: L7sParams, offsets: Floats
) -> Iterator[PlacedWindow]:
    model = take.model
    state = start_l7s_state(take.part(slice(0, 1)), model, params)
    inputs, track = take.part(slice(0, 0)), None
    first = 0
    for solved, own in cut_windows(len(take.step), rate_hz):
        fresh = take.part(slice(first + len(inputs.step), solved.stop))
        filtered, state = filter_block(state, fresh, model, rate_hz, params)
        if track is None:
            inputs, track = fresh, filtered
        else:
            left = slice(solved.start - first, None)
            inputs, track = join_inputs(inputs.part(left), fresh), join_tracks(track.part(left), filtered)
        del fresh, filtered
        first = solved.start
        R, p, passes, moved = track.R[own], track.p[own], 0, 0.0
        if valid is not None:
            whole = smooth_track(track, inputs, valid[solved], model, rate_hz, offsets, first)
            R, p, passes, moved = whole.R[own], whole.p[own], whole.passes, whole.moved
        yield PlacedWindow(first + own.start, inputs.part(own), track.part(own), R, p, passes, moved, state.P)


def join_inputs(earlier: L7sInputs, later: L7sInputs) -> L7sInputs:
    """Concatenate two consecutive blocks."""
    return L7sInputs(
        np.concatenate((earlier.R, later.R)),
        np.concatenate((earlier.acc, later.acc)),
        np.concatenate((earlier.step, later.step)),
        earlier.worn,
    )


def join_tracks(earlier: L7sTrack, later: L7sTrack) -> L7sTrack:
    """Concatenate two consecutive tracks."""
    pairs = zip(vars(earlier).values(), vars(later).values(), strict=True)
    return L7sTrack(*(np.concatenate(pair) for pair in pairs))
