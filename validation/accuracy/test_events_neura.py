"""Contacts on neura_walk, whole chain, against still flags and the heel marker.

Initial contact from the Vicon heel marker: its speed falls below 0.5 m/s for the last time before the foot is
still, interpolated (velocity criterion as in Ghoussayni et al. 2004, Gait & Posture 20:266). The threshold
agrees with the data set's description (the still flag rises 0.24 to 0.35 s after the heel stops); a lower and
a higher one are also reported. Vertical velocity is no criterion here: the heel skims the floor at 2 to 3 m/s
for 0.1 s. The lag between IMU and Vicon (0 to 3 samples) is not removed.
"""

from __future__ import annotations

import csv
import json
from functools import cache

import numpy as np

from sagittal.core import calibration, events, timeline
from sagittal.core.errors import Notice
from sagittal.core.events.result import GaitEvents, Strides
from sagittal.core.formats import SourceFile, parse_manifest, read_recording
from sagittal.core.frames import SIDES, SUFFIX, Floats, Side
from sagittal.core.fusion.mahony import estimate_orientations
from tests.data import data_folder
from tests.helpers.event_scoring import match
from validation.figures import record

RATE = 100.0
BEFORE_S = 0.45
STOP_MPS = 0.5
OTHER_MPS = (0.3, 1.0)
SENSORS = {
    "00B40B91": "pelvis", "00B40C45": "thigh_l", "00B40C3C": "thigh_r", "00B40BA5": "shank_l",
    "00B40C35": "shank_r", "00B40C55": "foot_l", "00B40C48": "foot_r", "00B40C44": None, "00B40C47": None,
    "00B40C49": None, "00B40C4A": None,
}  # fmt: skip


@cache
def found() -> tuple[GaitEvents, Strides, tuple[Notice, ...]]:
    files = [
        SourceFile(p.name, p.stat().st_size, p.read_bytes)
        for p in sorted((data_folder("neura_walk") / "rawimu").glob("*.txt"))
    ]
    manifest = parse_manifest(json.dumps({"sensors": SENSORS}).encode())
    calibrated = calibration.calibrate(timeline.synchronise(read_recording(files, manifest)))
    orientations = estimate_orientations(calibrated)
    contacts = events.detect(orientations)
    strides = events.stride_list(contacts, orientations, calibrated.calibration.turning)
    return contacts, strides, contacts.notices + strides.notices


@cache
def flag_rises(side: Side) -> Floats:
    """Moments the reviewed still flag of a foot rises, s."""
    path = data_folder("neura_walk") / "rawstep-detect" / "S02-Trial-Walk-1-revStepDetect.csv"
    flags = np.loadtxt(path, delimiter=",", skiprows=1)[:, SIDES.index(side)]
    return np.asarray((np.flatnonzero(np.diff(flags) > 0) + 1) / RATE)


@cache
def heel_stops(side: Side, stop_mps: float = STOP_MPS) -> tuple[float, ...]:
    """Last moment before each still flag at which the heel marker becomes slower than `stop_mps`, s."""
    with (data_folder("neura_walk") / "reference_angles.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    heel = np.array([[float(r[f"heel_{a}_{SUFFIX[side]}_m"]) for a in "xyz"] for r in rows])
    speed = np.linalg.norm(np.gradient(heel, 1.0 / RATE, axis=0), axis=1)
    slows = np.flatnonzero((speed[:-1] >= stop_mps) & (speed[1:] < stop_mps))
    exact = (slows + (speed[slows] - stop_mps) / (speed[slows] - speed[slows + 1])) / RATE
    return tuple(float(exact[exact < rise][-1]) for rise in flag_rises(side))


def test_reviewed_still_flags_follow_exactly_one_contact() -> None:
    contacts, _, notices = found()
    assert "no_toe_off" not in {n.code for n in notices}
    hits, used = 0, 0
    for side in SIDES:
        ic = np.array(contacts.times(side, "ic"))
        assert len(flag_rises(side)) == 7
        inside = [int(((ic > rise - BEFORE_S) & (ic <= rise)).sum()) for rise in flag_rises(side)]
        assert max(inside) <= 1
        hits += inside.count(1)
        used += len(ic)
    assert hits >= 11
    assert used == hits, "no contact away from a flag"


def test_no_contact_while_standing() -> None:
    for event in found()[0].events:
        assert 11.0 < event.time_s < 21.5, event


def test_contacts_agree_with_the_heel_marker() -> None:
    rows = []
    for side in SIDES:
        for stop_mps in (STOP_MPS, *OTHER_MPS):
            result = match(found()[0].times(side, "ic"), heel_stops(side, stop_mps), 0.3)
            assert not result.extra
            assert stop_mps != STOP_MPS or abs(result.mean_ms) <= 50
            figures = (f"{len(result.errors)}/7", f"{result.mean_ms:+.1f}", f"{result.sd_ms:.1f}")
            rows.append((side, f"{stop_mps:g}", *figures))
    record(
        "Contacts on neura_walk",
        ("foot", "heel slower than m/s", "flags with one IC", "mean ms", "sd ms"),
        rows,
        "Contacts of the published pitch rule. Error is found − the moment the Vicon heel marker slows down"
        " before the reviewed still flag; the lag between IMU and Vicon (0 to 3 samples) is not removed."
        " Limit at 0.5 m/s: |mean| ≤ 50 ms; the other rows show what the choice of that speed does. At least"
        " 11 of 14 flags have exactly one IC in the 0.45 s before, no IC stands elsewhere. Missed by the"
        " rule: the first step of the left foot (before its first foot-off), the right step in the turn and"
        " the right closing step, which hardly pitch.",
    )


def test_strides_leave_out_the_turn_the_missed_contact_and_how_the_walk_starts_and_stops() -> None:
    _, strides, notices = found()
    assert [s.excluded_reason for s in strides.strides if s.side == "left"].count("turn") == 2
    assert [s.excluded_reason for s in strides.strides if s.side == "right"].count("incomplete") == 1
    used = strides.select_used()
    assert [len(strides.select_used(side)) for side in SIDES] == [2, 1]
    assert {f for s in used for f in s.flags} == {"near_turn"}
    assert all(1.2 < s.duration_s < 1.6 for s in used)
    assert all(abs(s.turn_rad) < np.radians(20.0) for s in used if s.turn_rad is not None)
    assert "short_walk" in {n.code for n in notices}
