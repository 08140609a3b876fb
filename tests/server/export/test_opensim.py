"""OpenSim's files by its own text rules, and signs by the axes of its model."""

from __future__ import annotations

import io
import zipfile
from types import SimpleNamespace

import numpy as np
import pytest

from sagittal.core.angles import SIGNS, JointAngles, list_leg_joints
from sagittal.core.angles.cardan import cardan_zxy, compute_headings, pelvis_angles
from sagittal.core.errors import FormatError
from sagittal.core.formats.orientation_table import read_orientation_table
from sagittal.core.frames import R_NEUTRAL, SIDES, SUFFIX, Floats, Segment
from sagittal.core.rotation import about, angle_between, conjugate, exp, from_matrix, multiply
from sagittal.server.export.kinds import write_export
from sagittal.server.export.opensim import IMU_NAMES, write_motion, write_orientations
from tests.server import analysed, walk
from tests.server.export.opened import open_walk

TO_GROUND = about(0, -np.pi / 2)
"""World with z up → OpenSim's ground with y up."""


def read_motion(data: bytes) -> dict[str, Floats]:
    """As OpenSim reads: name, keys until endheader, one row of tab-separated labels, rows of numbers."""
    lines = data.decode().split("\n")
    end = lines.index("endheader")
    mapping = dict(line.split("=") for line in lines[1:end])
    names, body = lines[end + 1].split("\t"), [line.split("\t") for line in lines[end + 2 : -1]]
    assert lines[0] == "Coordinates"
    assert (mapping["inDegrees"], lines[-1]) == ("yes", "")
    assert (int(mapping["nRows"]), int(mapping["nColumns"])) == (len(body), len(names))
    table = np.array(body, np.float64)
    assert names[0] == "time"
    assert (np.diff(table[:, 0]) > 0.0).all()
    return dict(zip(names, table.T, strict=True))


def moved(seed: int) -> dict[Segment, Floats]:
    """Randomly and smoothly moving segments with hinged knees and ankles."""
    t, rng = np.arange(200) / 50.0, np.random.default_rng(seed)

    def swing(size: float) -> Floats:
        rates, phases = rng.uniform(0.3, 1.5, (2, 3))
        return np.asarray(size * np.sin(2.0 * np.pi * np.outer(t, rates) + phases))

    neutral = from_matrix(R_NEUTRAL)
    q: dict[Segment, Floats] = {"pelvis": multiply(about(2, 1.2 * t), multiply(neutral, exp(swing(0.15))))}
    for side in SIDES:
        for joint, proximal, distal in list_leg_joints(side):
            size = swing(0.4)
            turn = exp(size) if joint == "hip" else about(2, size[:, 0])
            q[distal] = multiply(q[proximal], turn)
    return q


def measure(q: dict[Segment, Floats]) -> JointAngles:
    tilt, obliquity = pelvis_angles(q["pelvis"])
    result = {"pelvis_tilt": tilt, "pelvis_obliquity": obliquity}
    for side in SIDES:
        for joint, proximal, distal in list_leg_joints(side):
            parts = cardan_zxy(multiply(conjugate(q[proximal]), q[distal])).T
            for (name, right, left), part in zip(SIGNS[joint], parts, strict=True):
                result[f"{name}_{SUFFIX[side]}"] = (right if side == "right" else left) * part
    n = len(tilt)
    oriented = SimpleNamespace(t_s=np.arange(n) / 50.0, q=q, valid=dict.fromkeys(q, np.ones(n, bool)))
    return JointAngles(oriented.t_s, result, {}, headings=compute_headings(oriented))


def test_the_models_axes_turned_by_the_coordinates_give_the_segments() -> None:
    """Axes of Rajagopal 2016: pelvis z, x, y; hip right z, x, y, left z, −x, −y; knee −z, ankle z."""
    q = moved(3)
    result = {n: np.radians(x) for n, x in read_motion(write_motion(measure(q))).items()}
    pelvis = multiply(
        multiply(about(2, result["pelvis_tilt"]), about(0, result["pelvis_list"])),
        about(1, result["pelvis_rotation"]),
    )
    true = multiply(TO_GROUND, q["pelvis"])
    # the walk's first direction is free: only what stays the same all the time may differ
    course = multiply(true, conjugate(pelvis))
    assert np.abs(course[:, [1, 3]]).max() < 1e-6, "they differ about the vertical only"
    assert np.ptp(angle_between(course, course[:1])) < 1e-6
    for side in SIDES:
        k, own = SUFFIX[side], 1.0 if side == "right" else -1.0
        position = multiply(
            multiply(about(2, result[f"hip_flexion_{k}"]), about(0, own * result[f"hip_adduction_{k}"])),
            about(1, own * result[f"hip_rotation_{k}"]),
        )
        legs = [s for _, _, s in list_leg_joints(side)]
        turns = [position, about(2, -result[f"knee_angle_{k}"]), about(2, result[f"ankle_angle_{k}"])]
        place = pelvis
        for segment, turn in zip(legs, turns, strict=True):
            place = multiply(place, turn)
            expected = multiply(conjugate(course[:1]), multiply(TO_GROUND, q[segment]))
            assert angle_between(place, expected).max() < 1e-6


def test_lost_moments_and_joints_without_sensors_are_left_out() -> None:
    angles = measure(
        {s: x for s, x in moved(1).items() if s != "foot_l"} | {"foot_l": np.full((200, 4), np.nan)}
    )
    angles.angles["hip_flexion_r"][50:60] = np.nan
    motion = read_motion(write_motion(angles))
    assert "ankle_angle_l" not in motion
    assert len(motion["time"]) == 190
    with pytest.raises(FormatError, match="No joint angle"):
        write_motion(JointAngles(angles.t_s, {}, {}))


def test_orientations_are_read_back_and_standing_is_the_identity_in_opensim() -> None:
    poses = walk.poses(lost=(3.0, 3.5))
    read = read_orientation_table(write_orientations(poses, set(poses.q)), "orientations.sto")
    assert list(read.q) == [name for s, name in IMU_NAMES.items() if s in poses.q]
    assert len(read.t_s) == np.count_nonzero(poses.valid)
    for segment, q in poses.q.items():
        assert angle_between(read.q[IMU_NAMES[segment]], q[poses.valid]).max() < 1e-6
        assert ((read.q[IMU_NAMES[segment]][1:] * read.q[IMU_NAMES[segment]][:-1]).sum(axis=1) > 0.0).all()
    assert multiply(TO_GROUND, from_matrix(R_NEUTRAL)) == pytest.approx([1.0, 0.0, 0.0, 0.0])


def test_the_zip_holds_both_with_the_strides_and_only_worn_sensors() -> None:
    archive = zipfile.ZipFile(io.BytesIO(write_export("opensim", open_walk())))
    assert archive.namelist() == ["angles.mot", "orientations.sto", "strides.csv", "about.csv"]
    motion = read_motion(archive.read("angles.mot"))
    angles = open_walk().bundle.angles
    assert angles is not None
    assert motion["knee_angle_l"] == pytest.approx(np.degrees(angles.angles["knee_flexion_l"]), abs=1e-5)
    assert list(read_orientation_table(archive.read("orientations.sto"), "o.sto").q) == [
        "pelvis_imu",
        "calcn_r_imu",
        "calcn_l_imu",
    ]
    with pytest.raises(FormatError, match="no joint angles"):
        write_export("opensim", open_walk(files={"analysis.json": analysed.files()["analysis.json"]}))
