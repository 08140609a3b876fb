"""Parameters that a perfect analysis of a simulated walk would give, from true events, paths and angles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sagittal.core.angles import JointAngles
from sagittal.core.body.feet import FootTracks
from sagittal.core.events.result import GaitEvent, GaitEvents
from sagittal.core.frames import FOOT, SIDES
from sagittal.core.parameters.measure import MeasuredGait, Tracks, measure_gait
from sagittal.core.pipeline import PipelineConfig, analyse
from sagittal.core.simulate import WalkTruth, simulate_scenario
from sagittal.core.simulate.sensors import PLACES
from sagittal.core.simulate.walker import Anatomy
from sagittal.core.subject.shoe import Shoe
from tests.helpers.kept import keep

_ANATOMY = Anatomy()
HEEL_M, TIP_M = _ANATOMY.heel, _ANATOMY.toe
"""The reference person's sole behind and in front of the ankle."""

TIP_UP_M = _ANATOMY.rocker_radius - np.sqrt(_ANATOMY.rocker_radius**2 - (TIP_M - _ANATOMY.rocker_start) ** 2)
"""How far the rolling forefoot holds the tip off the floor."""


def true_tracks(truth: WalkTruth) -> Tracks:
    """Tracks without any error; a foot is on the floor from the first to the last touch of its sole."""
    n = len(truth.t_s)
    events = []
    for side, contacts in truth.contacts.items():
        events += [GaitEvent(t, side, "ic", "truth", t) for t in contacts.contact.tolist()]
        events += [GaitEvent(t, side, "tc", "truth", t) for t in contacts.release.tolist()]
    feet = FootTracks(
        t_s=truth.t_s,
        rate_hz=truth.rate_hz,
        p={s: truth.p[FOOT[s]] for s in SIDES},
        q={s: truth.q[FOOT[s]] for s in SIDES},
        still=truth.flat,
        valid=dict.fromkeys(SIDES, np.ones(n, np.bool_)),
        linked=True,
        source="truth",
        body=replace(
            truth.body, standing_width=0.2, sole_back=HEEL_M, sole_front=TIP_M, sole_tip_up=TIP_UP_M
        ),
    )
    return Tracks(
        t_s=truth.t_s,
        rate_hz=truth.rate_hz,
        events=GaitEvents(tuple(sorted(events, key=lambda e: e.time_s))),
        q={FOOT[s]: truth.q[FOOT[s]] for s in SIDES},
        valid={FOOT[s]: np.ones(n, np.bool_) for s in SIDES},
        feet=feet,
        angles=JointAngles(truth.t_s, truth.subtract_standing(), truth.zero_offset),
    )


def standing_width(truth: WalkTruth) -> float:
    """Between the ankles in the first standing, to the centimetre of a tape."""
    standing = (truth.t_s >= truth.zero[0]) & (truth.t_s < truth.zero[1])
    apart = (truth.p["foot_l"] - truth.p["foot_r"])[standing, :2].mean(axis=0)
    return round(float(np.hypot(*apart)), 2)


@keep
def measured_walk(name: str, seed: int = 5) -> tuple[WalkTruth, MeasuredGait, MeasuredGait]:
    """Named script: ground truth, parameters from truth, and parameters from analysis."""
    take = simulate_scenario(name, seed)
    ahead = PLACES["foot_l"][0]
    shoe = Shoe(HEEL_M + ahead, TIP_M - ahead, TIP_UP_M)
    subject = replace(take.recording.subject, shoe=shoe, standing_width_m=standing_width(take.truth))
    analysis = analyse(replace(take.recording, subject=subject), PipelineConfig())
    assert analysis.measured is not None
    return take.truth, measure_gait(true_tracks(take.truth)), analysis.measured
