"""Feet of simulated people as the finders of contacts see them, with their true contacts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

from sagittal.core import calibration, timeline
from sagittal.core.events.foot_movement import FootMovement, measure_foot_movements
from sagittal.core.frames import FOOT, Bools, Floats, Segment, Side
from sagittal.core.fusion.mahony import estimate_orientations
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.simulate import WalkTruth, simulate_scenario

WORN: tuple[Segment, ...] = ("pelvis", "foot_l", "foot_r")


@dataclass(frozen=True, eq=False)
class WalkedFoot:
    """One foot: orientations (n, 4), whether they are known (n,), angular speed (n,), force (n, 3), truth.

    Parameters
    ----------
    contacts, releases : true first and last touches of the sole, s.
    """

    q: Floats
    valid: Bools
    speed: Floats
    acc: Floats
    contacts: Floats
    releases: Floats


@cache
def walked(
    name: str, seed: int = 1, height_m: float = 1.75, rate_hz: float = 100.0
) -> tuple[Orientations, dict[Segment, FootMovement], WalkTruth]:
    """Orientations and motions of both feet of a named script, worn with a pelvis, and the truth."""
    take = simulate_scenario(name, seed, height_m, rate_hz, WORN)
    calibrated = calibration.calibrate(timeline.synchronise(take.recording))
    orientations = estimate_orientations(calibrated)
    whole = slice(0, len(orientations.t_s))
    motions = {foot: x.cut(whole) for foot, x in measure_foot_movements(calibrated).items()}
    return orientations, motions, take.truth


@cache
def walked_foot(name: str, side: Side, seed: int = 1) -> WalkedFoot:
    """One foot of a named script."""
    orientations, motions, truth = walked(name, seed)
    foot = FOOT[side]
    return WalkedFoot(
        orientations.q[foot],
        orientations.valid[foot],
        motions[foot].speed,
        motions[foot].acc,
        truth.contacts[side].contact,
        truth.contacts[side].release,
    )
