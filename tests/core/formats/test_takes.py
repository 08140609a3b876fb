"""Which files of a folder are one take."""

from __future__ import annotations

from pathlib import Path

import pytest

from sagittal.core.formats.takes import find_takes
from tests.core.formats import vendor_files as made
from tests.core.formats.making import mt_text, signals, zipped

ACC, GYR = signals(20)
MT = mt_text(ACC, GYR).encode()
TABLE = b"acc_x,acc_y,acc_z,gyr_x\n" + b"1,2,3,4\n" * 5
CHANNELS = made.bids_parts()

LAYOUTS: dict[str, tuple[dict[str, bytes], dict[str, set[str]]]] = {
    "a folder for each take": (
        {"p1/a_00B40B91.txt": MT, "p1/b_00B40C35.txt": MT, "p2/deep/x.txt": MT, "p2/read me.txt": b"hello"},
        {"p1": {"a_00B40B91.txt", "b_00B40C35.txt"}, "p2/deep": {"x.txt"}},
    ),
    "trials side by side": (
        {"all/1-1_lf.txt": TABLE, "all/1-1_rf.txt": TABLE, "all/1-2_lf.txt": TABLE, "all/1-2_rf.txt": TABLE},
        {"all/1-1": {"1-1_lf.txt", "1-1_rf.txt"}, "all/1-2": {"1-2_lf.txt", "1-2_rf.txt"}},
    ),
    "whole takes side by side": (
        {"one.csv": made.apdm_lab(), "two.zip": zipped({"a_00B40B91.txt": MT}), "three.mvnx": made.mvnx()},
        {"one.csv": {"one.csv"}, "two.zip": {"two.zip"}, "three.mvnx": {"three.mvnx"}},
    ),
    "the manifest above": (
        {
            "manifest.json": b"{}",
            "p1/a.csv": TABLE,
            "p2/a.csv": TABLE,
            "p2/manifest.json": b'{"sensors": {}}',
        },
        {"p1": {"a.csv", "manifest.json"}, "p2": {"a.csv", "manifest.json"}},
    ),
    "BIDS": (
        CHANNELS | {"participants.tsv": b"participant_id\tage\n"},
        {"sub-01/motion/sub-01_task-walk": {name.rsplit("/", 1)[-1] for name in CHANNELS}},
    ),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_takes_are_found_in_any_layout(tmp_path: Path, layout: str) -> None:
    files, expected = LAYOUTS[layout]
    for name, data in files.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
    (tmp_path / ".hidden").write_bytes(MT)
    takes = find_takes(tmp_path)
    assert {t.name: {p.name for p in t.paths} for t in takes} == expected
    if layout == "BIDS":
        assert takes[0].labels == {"sub": "01", "task": "walk"}
    if layout == "the manifest above":
        assert [t.paths[-1].parent.name for t in takes] == [tmp_path.name, "p2"]
