"""Simulated squats with sensors where the chain expects them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import radians

import numpy as np

from sagittal.core.body.chain.filter import ChainFilter, ChainFilterParams, ChainMotion
from sagittal.core.body.chain.geometry import LegGeometry
from sagittal.core.body.chain.model import build_leg_chain, leg_segments
from sagittal.core.calibration.fixed_offset import make_fixed_mounts
from sagittal.core.frames import FOOT, Floats, Segment, Side
from sagittal.core.rotation import from_matrix
from sagittal.core.simulate import RecordingSetup, SensorNoise, Squats, SquatSimulation, simulate_squats
from sagittal.core.simulate.squat_chain import measure_leg, place_sensors
from sagittal.core.simulate.truth import joint_angles
from sagittal.core.squat.joints import JOINTS

HEIGHT_M = 1.75


def squat_on(
    side: Side = "right",
    rate_hz: float = 50.0,
    noise: SensorNoise | None = None,
    seed: int = 0,
    repetitions: int = 3,
) -> SquatSimulation:
    """A hinge for a knee, sensors put on by the fixed offset."""
    squats = Squats(side=side, hinged=True, repetitions=repetitions)
    setup = RecordingSetup(rate_hz=rate_hz, noise=noise)
    return simulate_squats(
        squats, HEIGHT_M, seed, setup, place_sensors(measure_leg(HEIGHT_M, side), HEIGHT_M)
    )


def stack_signals(result: SquatSimulation, side: Side) -> tuple[Floats, Floats]:
    """Rates and forces (n, 3, 3) of errorless sensors, from the foot up."""
    segments = leg_segments(side)
    return tuple(np.stack([getattr(result.ideal[s], k) for s in segments], axis=1) for k in ("gyr", "acc"))  # type: ignore[return-value]


def start_filter(
    acc: Floats,
    rate_hz: float,
    leg: LegGeometry,
    mounts: Mapping[Segment, Floats] | None = None,
    params: ChainFilterParams | None = None,
) -> ChainFilter:
    """A filter that has seen two seconds of standing."""
    chain = build_leg_chain(leg, mounts or make_fixed_mounts(leg.side))
    return ChainFilter(chain, rate_hz, acc[: round(2.0 * rate_hz)].mean(axis=0), params)


def find_errors_deg(
    motion: ChainMotion,
    leg: LegGeometry,
    result: SquatSimulation,
    mounts: Mapping[Segment, Floats] | None = None,
) -> Floats:
    """RMS errors (7,) of the angles `JOINTS`."""
    links = build_leg_chain(leg, mounts or make_fixed_mounts(leg.side)).links(motion.angles)
    q = {s: from_matrix(R) for s, R in zip(leg_segments(leg.side), links, strict=True)}
    foot = FOOT[leg.side]
    angles = joint_angles({**q, foot: result.truth.q[foot]})
    errors = [angles[f"{j}_{leg.side[0]}"] - result.truth.angles[f"{j}_{leg.side[0]}"] for j in JOINTS]
    return np.asarray(np.degrees(np.sqrt(np.mean(np.square(errors), axis=1))))


def run(
    result: SquatSimulation,
    leg: LegGeometry,
    mounts: Mapping[Segment, Floats] | None = None,
    bias_deg: float = 0.0,
    params: ChainFilterParams | None = None,
) -> Floats:
    """RMS errors (7,) in degrees of a chain on errorless signals with a bias of all gyroscopes, °/s."""
    gyr, acc = stack_signals(result, leg.side)
    motion = start_filter(acc, result.truth.rate_hz, leg, mounts, params).advance(
        gyr + radians(bias_deg), acc
    )
    return find_errors_deg(motion, leg, result, mounts)


def split(n: int, sizes: Sequence[int]) -> list[slice]:
    """Blocks of these sizes in turn, over n samples."""
    result, position, k = [], 0, 0
    while position < n:
        size = sizes[k % len(sizes)]
        result.append(slice(position, min(n, position + size)))
        position, k = position + size, k + 1
    return result
