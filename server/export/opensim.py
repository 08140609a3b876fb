"""Export to OpenSim: joint angles as coordinates (.mot), orientations for OpenSense (.sto).

Coordinates and signs follow the model of Rajagopal et al. 2016 (doi:10.1109/TBME.2016.2586891); files use the
text format of OpenSim 4. OpenSim's ground frame has x forward, y up, z to the right.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Final

import numpy as np

from sagittal.core.angles import JointAngles
from sagittal.core.angles.cardan import cardan_zxy
from sagittal.core.body.poses import Poses
from sagittal.core.errors import FormatError
from sagittal.core.frames import SIDES, SUFFIX, Floats, Segment
from sagittal.core.rotation import about, multiply
from sagittal.server.export import sheets
from sagittal.server.export.content import ExportContent
from sagittal.server.export.zipping import zip_files
from sagittal.server.report.files.columns import write_csv

LEG: Final = (
    ("hip_flexion", "hip_flexion"),
    ("hip_adduction", "hip_adduction"),
    ("hip_rotation", "hip_rotation"),
    ("knee_flexion", "knee_angle"),
    ("ankle_dorsiflexion", "ankle_angle"),
)
"""Our joint angle → its coordinate; signs are the same on both sides."""

IMU_NAMES: Final[Mapping[Segment, str]] = {
    "pelvis": "pelvis_imu",
    "thigh_r": "femur_r_imu",
    "shank_r": "tibia_r_imu",
    "foot_r": "calcn_r_imu",
    "thigh_l": "femur_l_imu",
    "shank_l": "tibia_l_imu",
    "foot_l": "calcn_l_imu",
    "chest": "torso_imu",
}
"""Segment → frame expected by OpenSense in the model."""


def write_opensim(content: ExportContent) -> bytes:
    """Write angles.mot, orientations.sto if there are poses, and the list of included strides."""
    angles = content.bundle.angles
    if angles is None:
        raise FormatError("export_not_possible", "This analysis has no joint angles; OpenSim takes nothing.")
    files = {"angles.mot": write_motion(angles)}
    if content.has_poses:
        segments = (content.bundle.calibration or {}).get("segments", IMU_NAMES)
        files["orientations.sto"] = write_orientations(content.poses, segments)
    for name, table in (("strides", sheets.list_cycles(content)), ("about", sheets.list_about(content))):
        files[f"{name}.csv"] = write_csv(table.header, table.rows)
    return zip_files(files)


def write_motion(angles: JointAngles) -> bytes:
    """Write coordinates in degrees over time; rows with an unknown coordinate are omitted."""
    columns = {n: np.degrees(x) for n, x in find_coordinates(angles).items() if np.isfinite(x).any()}
    if not columns:
        raise FormatError("export_not_possible", "No joint angle of this analysis is an OpenSim coordinate.")
    table = np.column_stack((angles.t_s, *columns.values()))
    table = table[np.isfinite(table).all(axis=1)]
    head = (
        f"Coordinates\nversion=1\nnRows={len(table)}\nnColumns={table.shape[1]}\ninDegrees=yes\nendheader\n"
    )
    lines = ["\t".join(("time", *columns)), *("\t".join(f"{x:.6f}" for x in row) for row in table.tolist())]
    return (head + "\n".join(lines) + "\n").encode()


def find_coordinates(angles: JointAngles) -> dict[str, Floats]:
    """Coordinate → (n,) rad, NaN where unknown.

    OpenSim's pelvis rotates about z, x, y of ground (tilt, list, rotation), ours about y, x, z. Pelvis
    rotation is its heading relative to the start of the trial.
    """
    by_name = angles.angles
    coordinates: dict[str, Floats] = {}
    if "pelvis_tilt" in by_name:
        heading = angles.headings.get("pelvis")
        turned = np.zeros(len(angles.t_s)) if heading is None else heading - _find_first(heading)
        q = multiply(about(1, turned), about(0, -by_name["pelvis_obliquity"]))
        tilt, side_down, rotation = cardan_zxy(multiply(q, about(2, -by_name["pelvis_tilt"]))).T
        coordinates |= {"pelvis_tilt": tilt, "pelvis_list": side_down}
        if heading is not None:
            finite = np.isfinite(rotation)
            rotation[finite] = np.unwrap(rotation[finite])
            coordinates["pelvis_rotation"] = rotation
    for side in reversed(SIDES):
        k = SUFFIX[side]
        coordinates |= {
            f"{name}_{k}": by_name[f"{ours}_{k}"] for ours, name in LEG if f"{ours}_{k}" in by_name
        }
    return coordinates


def _find_first(heading: Floats) -> float:
    finite = heading[np.isfinite(heading)]
    return float(finite[0]) if len(finite) else 0.0


def write_orientations(poses: Poses, instrumented: Collection[str]) -> bytes:
    """Write one quaternion "w,x,y,z" per instrumented segment and time; rows with missing data are omitted.

    Each describes the sensor axes aligned with its segment: x forward, y up, z to the right in quiet
    standing, in a world with z up. OpenSense's usual `sensor_to_opensim_rotations` of −π/2 0 0 maps standing
    to identity.

    Parameters
    ----------
    instrumented : instrumented segments.
    """
    segments = [s for s in IMU_NAMES if s in poses.q and s in instrumented]
    ok = poses.valid & np.all([np.isfinite(poses.q[s]).all(axis=1) for s in segments], axis=0)
    cells = []
    for segment in segments:
        q = poses.q[segment][ok]
        # keep consecutive quaternions in the same hemisphere, for interpolation
        flips = np.cumprod(np.where((q[1:] * q[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
        q = q * np.concatenate(([1.0], flips))[:, None] if len(q) else q
        cells.append([",".join(f"{x:.9f}" for x in row) for row in q.tolist()])
    head = f"DataRate={poses.rate_hz:.6f}\nDataType=Quaternion\nversion=3\nendheader\n"
    lines = ["\t".join(("time", *(IMU_NAMES[s] for s in segments)))]
    lines += ["\t".join((f"{t:.6f}", *row)) for t, *row in zip(poses.t_s[ok].tolist(), *cells, strict=True)]
    return (head + "\n".join(lines) + "\n").encode()
