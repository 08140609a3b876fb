"""Slips without a joint: found and turned back in any plane; a clean walk keeps its signals."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.agreement import check_agreement
from sagittal.core.agreement.slips import SensorSlip
from sagittal.core.agreement.stride_gravity import cut_strides, measure_stride_gravity
from sagittal.core.agreement.stride_slips import CREEPS, deny_slip, find_stride_slips, measure_creep
from sagittal.core.frames import Floats, Segment
from sagittal.core.rotation import exp, rotate
from sagittal.core.signals.recording import UniformRecording
from tests.helpers.perturbations import slip_sensor
from tests.helpers.walks import only, simulated

AT_S = 17.0


@cache
def walk() -> UniformRecording:
    return only(simulated("comfortable", 1)[0], "pelvis", "foot_l", "foot_r")


def find_axes(segment: Segment) -> tuple[Floats, Floats, Floats]:
    """Vertical, axis across and axis ahead of a sensor, unit vectors."""
    x = walk().sensors[segment]
    up = np.median(x.acc, axis=0)
    up /= np.linalg.norm(up)
    level = x.gyr - np.outer(x.gyr @ up, up)
    across = np.linalg.eigh(level.T @ level)[1][:, -1]
    return up, across, np.cross(across, up)


def test_a_clean_walk_has_no_slip() -> None:
    slips, judged, slow = find_stride_slips(walk())
    assert (slips, slow) == ((), ())
    assert set(judged) == {"pelvis", "foot_l", "foot_r"}
    assert check_agreement(walk()).recording is walk()


@pytest.mark.parametrize("segment", ["foot_l", "pelvis"])
@pytest.mark.parametrize("axis", [1, 2])
def test_a_slip_in_either_plane_is_found_and_turned_back(segment: Segment, axis: int) -> None:
    slipped = slip_sensor(walk(), segment, np.radians(12.0), AT_S, find_axes(segment)[axis])
    found = check_agreement(slipped)
    (slip,) = found.slips
    assert (slip.segment, slip.by, slip.is_repaired) == (segment, "strides", True)
    assert np.degrees(slip.turn_rad) == pytest.approx(12.0, abs=2.0)
    assert slip.at_s == pytest.approx(AT_S, abs=2.0)
    assert [n.code for n in found.recording.notices] == ["sensor_slipped"]
    late = slice(round((AT_S + 4.0) * 100), -100)
    truth, bad, good = (r.sensors[segment].acc[late] for r in (walk(), slipped, found.recording))
    assert np.abs(good - truth).mean() < 0.2 * np.abs(bad - truth).mean()


def test_a_foot_twisted_about_the_vertical_is_turned_back() -> None:
    slipped = slip_sensor(walk(), "foot_r", np.radians(30.0), AT_S, find_axes("foot_r")[0])
    (slip,) = check_agreement(slipped).slips
    assert np.degrees(slip.turn_rad) == pytest.approx(30.0, abs=4.0)
    assert slip.segment == "foot_r"


def test_a_turn_of_all_sensors_at_once_accuses_none() -> None:
    slope = walk()
    for segment in slope.sensors:
        slope = slip_sensor(slope, segment, np.radians(10.0), AT_S, find_axes(segment)[1])
    assert find_stride_slips(slope)[0] == ()


def test_a_sensor_that_slides_all_the_way_is_named() -> None:
    x, t = walk().sensors["pelvis"], walk().t_s
    across = find_axes("pelvis")[1]
    angle = np.radians(20.0) * (t - t[0]) / (t[-1] - t[0])
    q = exp(angle[:, None] * across)
    rate = rotate(q, x.gyr) - np.gradient(angle, t)[:, None] * across
    slid = replace(walk(), sensors={**walk().sensors, "pelvis": replace(x, acc=rotate(q, x.acc), gyr=rate)})
    slips, _, slow = find_stride_slips(slid)
    assert [n.code for n in slow] == [CREEPS] or [x.segment for x in slips] == ["pelvis"]
    strides = measure_stride_gravity("pelvis", slid.sensors["pelvis"], cut_strides(slid)["pelvis"], 100.0)
    turn = measure_creep(strides)
    assert turn is not None
    # the walk is a part of the recording
    assert 10.0 < np.degrees(turn) < 20.0


def test_the_flat_moments_of_a_foot_deny_a_slip_that_was_none() -> None:
    claimed = SensorSlip("foot_l", AT_S, 2.0, float(np.radians(19.0)), 0.05, (0.0, 0.0, 1.0))
    assert deny_slip(walk(), claimed)
    slipped = slip_sensor(walk(), "foot_l", np.radians(19.0), AT_S, find_axes("foot_l")[1])
    assert not deny_slip(slipped, claimed)
    assert not deny_slip(walk(), replace(claimed, segment="pelvis"))


def test_short_walks_are_not_judged() -> None:
    t = walk().t_s
    part = slice(0, round(11.0 * 100))
    short = replace(
        walk(),
        t_s=t[part],
        sensors={
            s: replace(
                x, acc=x.acc[part], gyr=x.gyr[part], mag=None, valid=x.valid[part],
                interpolated=x.interpolated[part],
            )
            for s, x in walk().sensors.items()
        },
    )  # fmt: skip
    assert find_stride_slips(short)[1] == {}
