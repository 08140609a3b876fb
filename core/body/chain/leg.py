"""Calibrated squat recording → orientations of the leg segments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from typing import Final

import numpy as np

from sagittal.core.body.chain.filter import ChainFilter, ChainFilterParams, ChainMotion
from sagittal.core.body.chain.geometry import LegGeometry
from sagittal.core.body.chain.model import RevoluteChain, build_leg_chain, leg_segments, require_leg
from sagittal.core.body.corrected import correct_signals
from sagittal.core.errors import EstimationError
from sagittal.core.estimators import SQUAT_CHAIN
from sagittal.core.frames import FOOT, R_NEUTRAL, Bools, Floats, Segment, Side
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.message import Message
from sagittal.core.rotation import from_matrix
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.rest import index_window

UNCERTAIN: Final = radians(5.0)
"""Angles with a larger standard deviation are withheld: after a silence of a sensor (our choice)."""


@dataclass(frozen=True, eq=False)
class LegMotion:
    """Result of the chain for one leg.

    Parameters
    ----------
    side : the squatting leg.
    orientations : of shank, thigh, pelvis and of the foot, which is in neutral orientation by definition.
    chain : the model. motion : of its joints from the sample `first` on.
    stands : (n,) True where the foot is on the floor.
    """

    side: Side
    orientations: Orientations
    chain: RevoluteChain
    motion: ChainMotion
    first: int
    stands: Bools


@dataclass(frozen=True, eq=False)
class LegSignals:
    """Input signals of the chain of a leg.

    Parameters
    ----------
    mounts : segment → (3, 3) R_segment_sensor of shank, thigh and pelvis.
    gyr, acc : (n, 3, 3) rad/s, m/s² of the three, bias-corrected, from standing on. valid : (n, 3).
    rest_force : (3, 3) m/s² mean over standing. first : sample of the recording at which they begin.
        standing : samples of standing, relative to `first`.
    """

    mounts: Mapping[Segment, Floats]
    gyr: Floats
    acc: Floats
    valid: Bools
    rest_force: Floats
    first: int
    standing: slice


def read_leg_signals(calibrated: CalibratedRecording, side: Side) -> LegSignals:
    """Sensor signals of a leg in the form used by its chain.

    Raises
    ------
    EstimationError `segments_missing`, `no_standing`.
    """
    recording, calibration = calibrated.recording, calibrated.calibration
    segments = leg_segments(side)
    require_leg(side, calibration.segments)
    mounts = {s: calibration.segments[s].R_segment_sensor for s in segments}
    acc, gyr, valid = correct_signals(calibrated, segments)
    standing = index_window(calibration.zero, recording.rate_hz)
    standing_valid = valid[standing]
    if not standing_valid.any(axis=0).all():
        silent = segments[int(np.argmin(standing_valid.any(axis=0)))]
        raise EstimationError(
            "no_standing",
            Message(
                "{silent} has no signal during quiet standing; stand still before squatting.", silent=silent
            ),
            sensor=silent,
            t_s=calibration.zero[0],
        )
    first = standing.start
    return LegSignals(
        mounts=mounts,
        gyr=np.ascontiguousarray(gyr[first:]),
        acc=np.ascontiguousarray(acc[first:]),
        valid=np.ascontiguousarray(valid[first:]),
        rest_force=np.stack(
            [acc[standing, i][standing_valid[:, i]].mean(axis=0) for i in range(len(segments))]
        ),
        first=first,
        standing=slice(0, standing.stop - first),
    )


def estimate_leg(
    calibrated: CalibratedRecording,
    geometry: LegGeometry,
    params: ChainFilterParams | None = None,
    stands: Bools | None = None,
) -> LegMotion:
    """Estimate the orientations of a leg above its foot, from the calibration's standing to the end of the
    recording.

    While the foot is lifted the shank is still tracked by gyroscope and gravity, but the foot is not: its own
    movement causes errors of up to 1.5° at knee and hip (docs/science/squat.md, "Two legs").

    Parameters
    ----------
    calibrated : sensors on shank, thigh and pelvis; others are ignored.
    stands : (n,) False where the foot is lifted; None = never lifted.

    Returns
    -------
    LegMotion; samples before standing are invalid, as are segments above an angle with an uncertainty of more
    than 5°, and a lifted foot.

    Raises
    ------
    EstimationError `segments_missing`, `no_standing`, `filter_diverged`. ParameterError `rate_out_of_range`.
    """
    recording = calibrated.recording
    signals = read_leg_signals(calibrated, geometry.side)
    chain = build_leg_chain(geometry, signals.mounts)
    motion = ChainFilter(chain, recording.rate_hz, signals.rest_force, params).advance(
        signals.gyr, signals.acc, signals.valid
    )
    valid = np.zeros((len(recording.t_s), len(signals.valid.T)), bool)
    valid[signals.first :] = signals.valid
    stood = np.ones(len(valid), bool) if stands is None else stands
    q, usable = _write_segments(chain, motion, valid, signals.first, geometry)
    usable[FOOT[geometry.side]] = usable[FOOT[geometry.side]] & stood
    orientations = Orientations(recording.t_s, recording.rate_hz, q, usable, engine=SQUAT_CHAIN.method)
    return LegMotion(geometry.side, orientations, chain, motion, signals.first, stood)


def _write_segments(
    chain: RevoluteChain, motion: ChainMotion, valid: Bools, first: int, geometry: LegGeometry
) -> tuple[dict[Segment, Floats], dict[Segment, Bools]]:
    """Orientations (n, 4) and their validity (n,), from the foot up."""
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
