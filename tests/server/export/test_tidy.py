"""The zip of CSV files for statistics."""

from __future__ import annotations

import io
import zipfile

from sagittal.server.export.tidy import write_tidy
from sagittal.server.export.zipping import EARLIEST
from tests.server.export.opened import open_walk


def test_the_zip_holds_seven_tables_each_with_its_own_header() -> None:
    archive = zipfile.ZipFile(io.BytesIO(write_tidy(open_walk())))
    first = {name: archive.read(name).decode().splitlines()[0].split(",")[:3] for name in archive.namelist()}
    assert first == {
        "strides_long.csv": ["subject", "visit", "cycle"],
        "strides_wide.csv": ["cycle", "side", "start_s"],
        "parameters.csv": ["parameter", "side", "n"],
        "curves.csv": ["pct_cycle", "pelvis_tilt_left_mean_deg", "pelvis_tilt_left_sd_deg"],
        "events.csv": ["time_s", "side", "kind"],
        "about.csv": ["what", "value"],
        "data_dictionary.csv": ["name", "label", "unit"],
    }
    assert {info.date_time for info in archive.infolist()} == {EARLIEST}
