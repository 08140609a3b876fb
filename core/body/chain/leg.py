"""From a calibrated take of squats to the orientations of the leg's segments."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from typing import Final

import numpy as np

from core.body.chain.filter import ChainFilter, ChainFilterParams, ChainMotion
from core.body.chain.geometry import LegGeometry
from core.body.chain.model import RevoluteChain, build_leg_chain, leg_segments
from core.body.corrected import correct_signals
from core.calibration.result import CalibratedRecording
from core.errors import EstimationError
from core.frames import FOOT, R_NEUTRAL, Bools, Floats, Segment, Side
from core.fusion.orientations import Orientations
from core.rest import index_window
from core.rotation import from_matrix

UNCERTAIN: Final = radians(5.0)
"""Angles with a larger standard deviation are withheld: after a silence of a sensor (our choice)."""


@dataclass(frozen=True, eq=False)
class LegMotion:
    """What the chain makes of a take.

    Parameters
    ----------
    side : leg that squats.
    orientations : of shank, thigh, pelvis and of the foot, which stands neutral by definition.
    chain : the model. motion : its joints from the sample `first` on.
    """

    side: Side
    orientations: Orientations
    chain: RevoluteChain
    motion: ChainMotion
    first: int


def estimate_leg(
    calibrated: CalibratedRecording, geometry: LegGeometry, params: ChainFilterParams | None = None
) -> LegMotion:
    """Orientations of one leg that stands on its foot from the calibration's standing to the end of the take.

    Parameters
    ----------
    calibrated : sensors on shank, thigh and pelvis; others are not read.

    Returns
    -------
    LegMotion; not valid are samples before the standing, and a segment while an angle below it is more
    uncertain than 5°.

    Raises
    ------
    EstimationError `segments_missing`, `no_standing`, `filter_diverged`. ParameterError `rate_out_of_range`.
    """
    recording, calibration = calibrated.recording, calibrated.calibration
    segments = leg_segments(geometry.side)
    mounts = {s: m.R_segment_sensor for s, m in calibration.segments.items()}
    chain = build_leg_chain(geometry, mounts)
    acc, gyr, valid = correct_signals(calibrated, segments)
    standing = index_window(calibration.zero, recording.rate_hz)
    known = valid[standing]
    if not known.any(axis=0).all():
        silent = segments[int(np.argmin(known.any(axis=0)))]
        raise EstimationError(
            "no_standing", f"{silent} has no signal while standing; stand still before squatting.",
            sensor=silent, t_s=calibration.zero[0],
        )  # fmt: skip
    rest = np.stack([acc[standing, i][known[:, i]].mean(axis=0) for i in range(len(segments))])
    first = standing.start
    motion = ChainFilter(chain, recording.rate_hz, rest, params).advance(
        gyr[first:], acc[first:], valid[first:]
    )
    q, usable = _write_segments(chain, motion, valid, first, geometry)
    orientations = Orientations(recording.t_s, recording.rate_hz, q, usable, engine="squat_chain")
    return LegMotion(geometry.side, orientations, chain, motion, first)


def _write_segments(
    chain: RevoluteChain, motion: ChainMotion, valid: Bools, first: int, geometry: LegGeometry
) -> tuple[dict[Segment, Floats], dict[Segment, Bools]]:
    """Orientations (n, 4) and where they are known (n,), from the foot up."""
    n = len(valid)
    foot = FOOT[geometry.side]
    stood = np.zeros(n, bool)
    stood[first:] = True
    q: dict[Segment, Floats] = {foot: np.tile(from_matrix(R_NEUTRAL), (n, 1))}
    usable: dict[Segment, Bools] = {foot: stood}
    for i, (segment, R) in enumerate(
        zip(leg_segments(geometry.side), chain.links(motion.angles), strict=True)
    ):
        q[segment] = q[foot].copy()
        q[segment][first:] = from_matrix(R)
        sure = (motion.sd[:, chain.first[i] : chain.first[i + 1]] < UNCERTAIN).all(axis=1)
        stood = stood & valid[:, i]
        stood[first:] &= sure
        usable[segment] = stood
    return q, usable
