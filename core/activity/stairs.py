"""Stair detection during walking, experimental (docs/science/activity.md, "Stairs"; Nazarahari 2021, 7.2.6).

On stairs the trunk leans more, and more variably, than in level walking. The thesis uses the variance of the
low-passed vertical acceleration, in which the bounce of the steps outweighs the inclination.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from sagittal.core.activity.frames import FRAME_HZ, Singles
from sagittal.core.activity.params import StairParams
from sagittal.core.errors import ParameterError
from sagittal.core.frames import Bools, Floats
from sagittal.core.message import Message
from sagittal.core.signals.rest import find_runs

StepKind = Literal["walking", "stairs_up", "stairs_down"]

EDGE_S = 1.5
"""Left out where walking begins and ends: the trunk leans into it."""

LEVEL, UP, DOWN = 0, 1, 2
KIND_OF: tuple[StepKind, ...] = ("walking", "stairs_up", "stairs_down")


def measure_walking(
    theta: Singles, walking: Bools, step_frames: Sequence[int], params: StairParams
) -> tuple[Floats, Floats]:
    """Standard deviation and mean of the inclination, rad, around the given frames.

    Parameters
    ----------
    theta : (f,) signed inclination. walking : (f,) in a bout. step_frames : frames of steps.

    Returns
    -------
    (steps,) each; NaN if the walk is too short. The start and end of walking are excluded.
    """
    from scipy.ndimage import uniform_filter1d

    half, edge = round(0.5 * params.window_s * FRAME_HZ), round(EDGE_S * FRAME_HZ)
    rocks, lean = np.full(len(step_frames), np.nan), np.full(len(step_frames), np.nan)
    runs = find_runs(walking)
    # a second holds two steps: what bounces with each is gone
    smooth = [uniform_filter1d(theta[a:b], FRAME_HZ, mode="nearest") for a, b in runs]
    starts = [a for a, _ in runs]
    for k, i in enumerate(step_frames):
        r = bisect_right(starts, i) - 1
        if r < 0 or i > runs[r][1]:
            continue
        first = runs[r][0]
        a, b = max(first + edge, i - half), min(runs[r][1] - edge, i + half + 1)
        if b - a >= 1.8 * half:
            own = smooth[r][a - first : b - first]
            rocks[k], lean[k] = own.std(), own.mean()
    return rocks, lean


def tell_stairs(rocks: Floats, lean: Floats, params: StairParams) -> np.ndarray:
    """Classify steps (steps,) as 0 level, 1 up or 2 down, smoothed over five steps; unknown ones as level."""
    up = (rocks > params.rocks_rad) & (lean > params.lean_rad)
    kinds = np.where(up, UP, np.where(rocks > params.down_rocks_rad, DOWN, LEVEL))
    if len(kinds) < 5:
        return kinds
    around = np.lib.stride_tricks.sliding_window_view(np.pad(kinds, 2, mode="edge"), 5)
    counts = np.stack([(around == kind).sum(axis=1) for kind in (LEVEL, UP, DOWN)])
    return np.asarray(counts.argmax(axis=0))


def calibrate_stairs(
    level: tuple[Floats, Floats],
    up: tuple[Floats, Floats],
    down: tuple[Floats, Floats],
    params: StairParams | None = None,
) -> StairParams:
    """Personal thresholds: halfway between a person's level walking and stairs in one recording.

    Parameters
    ----------
    level, up, down : inclination sd and mean (n,) each, from `measure_walking`, of steps of known kind.

    Raises
    ------
    ParameterError : `stairs_not_told_apart` if the person's stair walking cannot be distinguished from level
    walking.
    """
    (flat, ahead), (climbs, leans), (descends, _) = (
        (float(np.nanmedian(rocks)), float(np.nanmedian(lean))) for rocks, lean in (level, up, down)
    )
    if min(climbs, descends) <= flat or leans <= ahead:
        raise ParameterError(
            "stairs_not_told_apart",
            Message(
                "The trunk rocks by {flat:.1f}° level, {climbs:.1f}° up and {descends:.1f}° down, "
                "and leans {degrees:.1f}° further going up. Expected more on stairs.",
                flat=np.degrees(flat),
                climbs=np.degrees(climbs),
                descends=np.degrees(descends),
                degrees=np.degrees(leans - ahead),
            ),
        )
    return replace(
        params or StairParams(),
        rocks_rad=(flat * climbs) ** 0.5,
        down_rocks_rad=(flat * descends) ** 0.5,
        lean_rad=0.5 * (ahead + leans),
    )
