"""The real walk that the tests of this folder share."""

from __future__ import annotations

import pytest

from sagittal.core.formats import SourceFile, manifest_of, read_recording
from sagittal.core.signals.recording import Recording
from tests.core.quality.nine_sensors import NINE
from tests.data import data_folder


@pytest.fixture(scope="session")
def neura() -> Recording:
    folder = data_folder("neura_walk", "rawimu")
    return read_recording(
        [SourceFile.of_path(p) for p in sorted(folder.iterdir())], manifest_of({"sensors": dict(NINE)})
    )
