"""C3D files, opened by ezc3d."""

from __future__ import annotations

import errno
import io
import resource
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.events.edits import Edit
from sagittal.core.events.result import GaitEvents
from sagittal.server.export import c3d
from sagittal.server.export.content import ExportContent
from tests.server import walk
from tests.server.export.opened import open_walk

ezc3d = pytest.importorskip("ezc3d", reason="the extra c3d is not installed")


def opened(content: ExportContent, folder: Path) -> dict[str, Any]:
    archive = zipfile.ZipFile(io.BytesIO(c3d.write_c3d(content)))
    result = {}
    for name in archive.namelist():
        (folder / name).write_bytes(archive.read(name))
        result[name] = ezc3d.c3d(str(folder / name))
    return result


def test_markers_angles_and_events_are_read_back(tmp_path: Path) -> None:
    content = open_walk()
    (file,) = opened(content, tmp_path).values()
    point = file["parameters"]["POINT"]
    labels, points = point["LABELS"]["value"], file["data"]["points"]
    assert labels[:7] == ["MIDHIP", "LHJC", "LKJC", "LAJC", "RHJC", "RKJC", "RAJC"]
    assert (point["RATE"]["value"], point["UNITS"]["value"]) == ([100.0], ["mm"])
    assert labels[7:] == point["ANGLES"]["value"]
    true = walk.poses()
    knee_mm = points[:3, labels.index("LKJC")].T
    assert knee_mm == pytest.approx(1000.0 * true.p["shank_l"], abs=0.01)
    angles = content.bundle.angles
    assert angles is not None
    knee = np.degrees([angles.angles[f"knee_{n}_r"] for n in ("flexion", "adduction", "rotation")])
    assert points[:3, labels.index("RKneeAngles")] == pytest.approx(knee, abs=1e-4)
    event = file["parameters"]["EVENT"]
    minutes, seconds = event["TIMES"]["value"]
    assert 60.0 * minutes + seconds == pytest.approx(
        [e.time_s for e in content.bundle.events.events], abs=1e-5
    )
    first = content.bundle.events.events[0]
    assert event["CONTEXTS"]["value"][0] == first.side.capitalize()
    assert set(event["LABELS"]["value"]) == {"Foot Strike", "Foot Off"}
    assert event["USED"]["value"] == [len(content.bundle.events.events)]


def test_a_moment_without_signal_has_no_markers_and_a_left_out_stride_its_reason(tmp_path: Path) -> None:
    cycle = next(c for c in open_walk().cycles if c.excluded is None)
    edit = Edit("exclude_stride", cycle.side, (cycle.start_s + cycle.end_s) / 2, reason="stumbled")
    content = open_walk(edit)
    object.__setattr__(content, "poses", walk.poses(lost=(3.0, 3.5)))
    (file,) = opened(content, tmp_path).values()
    lost = np.isnan(file["data"]["points"][0, 0])
    assert (lost == ~walk.poses(lost=(3.0, 3.5)).valid).all()
    ours = file["parameters"]["SAGITTAL"]
    place = ours["STRIDE_REASONS"]["value"].index("manual:stumbled")
    assert ours["STRIDE_COUNTED"]["value"][place] == 0
    assert ours["STRIDE_BOUNDS_S"]["value"][:, place] == pytest.approx((cycle.start_s, cycle.end_s), abs=1e-4)


def test_a_file_that_the_disk_cut_short_is_not_handed_out() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))
    try:
        with pytest.raises(OSError, match=r"walk\.c3d") as e:
            c3d.write_c3d(open_walk())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert e.value.errno == errno.ENOSPC


def test_a_long_take_comes_in_parts_that_hold_every_event(tmp_path: Path) -> None:
    content = open_walk()
    many = replace(
        content.bundle,
        events=GaitEvents(
            tuple(
                replace(content.bundle.events.events[0], time_s=t)
                for t in np.linspace(0.0, 11.9, 600).tolist()
            )
        ),
    )
    parts = opened(replace(content, bundle=many), tmp_path)
    assert list(parts) == ["walk-1.c3d", "walk-2.c3d", "walk-3.c3d"]
    assert sum(p["data"]["points"].shape[2] for p in parts.values()) == 1200
    notices = []
    for part in parts.values():
        minutes, seconds = part["parameters"]["EVENT"]["TIMES"]["value"]
        notices += (60.0 * minutes + seconds + part["parameters"]["SAGITTAL"]["START_S"]["value"][0]).tolist()
    assert notices == pytest.approx([e.time_s for e in many.events.events], abs=1e-4)
    t_s = np.arange(3 * c3d.FRAMES) / 100.0
    assert [b - a for a, b in c3d.find_parts(len(t_s), t_s, ())] == [c3d.FRAMES] * 3


def test_without_the_library_the_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "ezc3d", None)
    with pytest.raises(FormatError, match=r"sagittal\[c3d\]"):
        c3d.write_c3d(open_walk())
