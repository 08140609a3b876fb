"""C3D export by ezc3d (extra `c3d`): joint centres as markers, joint angles, contacts as events.

C3D counts frames in 16 bits and list entries in 8, so long trials are split into several files.
"""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from pathlib import Path
from typing import Any, Final

import numpy as np

from sagittal.core.angles import SIGNS, JointAngles
from sagittal.core.errors import FormatError
from sagittal.core.events.result import GaitEvent
from sagittal.core.frames import FOOT, SHANK, SIDES, SUFFIX, THIGH, Floats
from sagittal.server.export.content import CycleRow, ExportContent
from sagittal.server.export.zipping import zip_files

FRAMES: Final = 65_535
"""Maximum number of frames per file."""

ENTRIES: Final = 255
"""Maximum number of entries per list."""

TEXT: Final = 127
"""Maximum number of characters per entry."""

POINT_BYTES: Final = 16
"""Per marker or angle and frame: three numbers and a residual."""

EVENT_NAMES: Final = {"ic": ("Foot Strike", 1), "tc": ("Foot Off", 2)}
"""Kind of contact → label and icon, as motion-capture programs write them."""


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Time series of a C3D file: label → (n, 3), NaN where unknown."""

    t_s: Floats
    rate_hz: float
    markers_mm: dict[str, Floats]
    angles_deg: dict[str, Floats]


def write_c3d(content: ExportContent) -> bytes:
    """Write a zip of walk.c3d, or of walk-1.c3d … for a trial too long for one file.

    Raises
    ------
    FormatError `no_c3d_library`, `export_not_possible`. OSError: the folder for temporary files is full.
    """
    try:
        import ezc3d
    except ImportError as error:
        raise FormatError(
            "no_c3d_library",
            "C3D files need the library ezc3d, which is not installed; the administrator can add it with "
            "pip install 'sagittal[c3d]'.",
        ) from error
    trajectories = collect_trajectories(content)
    events = content.bundle.events.events
    parts = find_parts(len(trajectories.t_s), trajectories.t_s, events)
    files = {}
    for i, (first, last) in enumerate(parts, start=1):
        name = "walk.c3d" if len(parts) == 1 else f"walk-{i}.c3d"
        files[name] = _write_part(ezc3d.c3d(), content, trajectories, first, last)
    return zip_files(files)


def collect_trajectories(content: ExportContent) -> Trajectories:
    """Joint centres in mm, and angles in degrees as three components: sagittal, frontal, transverse."""
    poses, angles = content.poses, content.bundle.angles
    places = {"MIDHIP": "pelvis"}
    for side in SIDES:
        letter = side[0].upper()
        ends = (("HJC", THIGH[side]), ("KJC", SHANK[side]), ("AJC", FOOT[side]))
        places |= {f"{letter}{joint}": segment for joint, segment in ends}
    markers = {
        label: np.where(poses.valid[:, None], 1000.0 * poses.p[segment], np.nan)  # type: ignore[index]
        for label, segment in places.items()
        if segment in poses.p
    }
    if angles is not None and len(angles.t_s) != len(poses.t_s):
        raise FormatError("export_not_possible", "Angles and poses have not the same length; analyse again.")
    return Trajectories(
        poses.t_s, poses.rate_hz, markers, {} if angles is None else {**_joints(angles), **_pelvis(angles)}
    )


def _joints(angles: JointAngles) -> dict[str, Floats]:
    centres = {}
    for side in SIDES:
        for joint, parts in SIGNS.items():
            names = [f"{name}_{SUFFIX[side]}" for name, _, _ in parts]
            if all(name in angles.angles for name in names):
                columns = [np.degrees(angles.angles[name]) for name in names]
                centres[f"{side[0].upper()}{joint.capitalize()}Angles"] = np.stack(columns, axis=1)
    return centres


def _pelvis(angles: JointAngles) -> dict[str, Floats]:
    """Tilt, upward obliquity and rotation; rotation is the heading in the world, without a walkway axis."""
    by_name, heading = angles.angles, angles.headings.get("pelvis")
    if "pelvis_tilt" not in by_name or heading is None:
        return {}
    tilt, up = by_name["pelvis_tilt"], by_name["pelvis_obliquity"]
    return {
        "RPelvisAngles": np.degrees(np.stack((tilt, up, heading), axis=1)),
        "LPelvisAngles": np.degrees(np.stack((tilt, -up, -heading), axis=1)),
    }


def find_parts(n: int, t_s: Floats, events: Sequence[GaitEvent]) -> list[tuple[int, int]]:
    """Ranges of frames [first, last) of nearly equal length, as few as the limits allow."""
    times = np.array([e.time_s for e in events])
    count = max(1, ceil(n / FRAMES))
    while True:
        edges = np.linspace(0, n, count + 1).round().astype(int)
        held = [np.count_nonzero(_lie_within(times, t_s, a, b)) for a, b in pairwise(edges)]
        if max(held) <= ENTRIES or count >= n:
            return [(int(a), int(b)) for a, b in pairwise(edges)]
        count += 1


def _lie_within(times: Floats, t_s: Floats, first: int, last: int) -> np.ndarray:
    """Mask of the times within a range of frames; the last range extends to the end of the trial."""
    end = t_s[last] if last < len(t_s) else np.inf
    return np.asarray((times >= t_s[first]) & (times < end))


def _write_part(
    file: Any, content: ExportContent, trajectories: Trajectories, first: int, last: int
) -> bytes:
    columns = {**trajectories.markers_mm, **trajectories.angles_deg}
    points = np.full((4, len(columns), last - first), 1.0)
    for i, values in enumerate(columns.values()):
        points[:3, i] = values[first:last].T
    file["parameters"]["POINT"]["RATE"]["value"] = [trajectories.rate_hz]
    file["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    file["parameters"]["POINT"]["LABELS"]["value"] = list(columns)
    file["data"]["points"] = points
    file.add_parameter("POINT", "ANGLES", list(trajectories.angles_deg))
    file.add_parameter("POINT", "ANGLE_UNITS", ["deg"])
    if content.estimated:
        file.add_parameter("SAGITTAL", "ESTIMATED", list(content.estimated))
    start = float(trajectories.t_s[first])
    events = content.bundle.events.events
    own = _lie_within(np.array([e.time_s for e in events]), trajectories.t_s, first, last)
    _add_events(file, content, [e for e, mine in zip(events, own, strict=True) if mine], start)
    began = _lie_within(np.array([c.start_s for c in content.cycles]), trajectories.t_s, first, last)
    _add_cycles(file, [c for c, mine in zip(content.cycles, began, strict=True) if mine], start)
    with tempfile.TemporaryDirectory(prefix="sagittal-c3d-") as folder:
        path = Path(folder) / "walk.c3d"
        file.write(str(path))
        written = path.read_bytes()
    # ezc3d does not report a full disk
    if len(written) < points.shape[2] * points.shape[1] * POINT_BYTES:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
    return written


def _add_events(file: Any, content: ExportContent, events: Sequence[GaitEvent], start_s: float) -> None:
    """Add the standard event group: minutes and seconds from the file's first frame."""
    n = len(events)
    file.add_parameter("EVENT", "USED", [n])
    if not n:
        return
    named = [EVENT_NAMES[e.kind] for e in events]
    times = np.array([divmod(e.time_s - start_s, 60.0) for e in events]).T
    subject = content.visit.subject[:TEXT]
    file.add_parameter("EVENT", "CONTEXTS", [e.side.capitalize() for e in events])
    file.add_parameter("EVENT", "LABELS", [label for label, _ in named])
    file.add_parameter("EVENT", "DESCRIPTIONS", [e.source[:TEXT] for e in events])
    file.add_parameter("EVENT", "SUBJECTS", [subject] * n)
    file.add_parameter("EVENT", "TIMES", times)
    file.add_parameter("EVENT", "ICON_IDS", [icon for _, icon in named])
    file.add_parameter("EVENT", "GENERIC_FLAGS", [0] * n)


def _add_cycles(file: Any, cycles: Sequence[CycleRow], start_s: float) -> None:
    """Add a custom group: start of the file within the trial, and included strides."""
    file.add_parameter("SAGITTAL", "START_S", [start_s])
    if cycles:
        file.add_parameter("SAGITTAL", "STRIDE_SIDES", [c.side.capitalize() for c in cycles])
        bounds = np.array([(c.start_s - start_s, c.end_s - start_s) for c in cycles]).T
        file.add_parameter("SAGITTAL", "STRIDE_BOUNDS_S", bounds)
        file.add_parameter("SAGITTAL", "STRIDE_COUNTED", [int(c.excluded is None) for c in cycles])
        file.add_parameter("SAGITTAL", "STRIDE_REASONS", [(c.excluded or "")[:TEXT] for c in cycles])
