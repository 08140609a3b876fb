"""Long trials processed in blocks and spooled to files give identical bytes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from math import pi

import pytest

from sagittal.core.formats import SourceFile, write_recording
from sagittal.core.frames import Segment
from sagittal.core.rotation import arrays
from sagittal.core.signals import held_samples
from sagittal.core.signals.recording import Recording
from sagittal.core.simulate import Arc, Dropout, RecordingSetup, Stand, Straight, simulate
from sagittal.server.results import analysing

STROLL = (Straight(5.0, 0.62, 0.54), Arc(1.5, pi, 0.52, 0.56))
WORN: Mapping[str, tuple[Segment, ...]] = {
    "pelvis and feet": ("pelvis", "foot_l", "foot_r"),
    "feet": ("foot_l", "foot_r"),
}
OF_THE_RUN = ("code_version", "analysed_at", "duration_s")
"""Of analysis.json, what differs from run to run."""


@pytest.fixture(scope="module")
def walk() -> Recording:
    """Two walks with a rest between them, lost packets and a sensor that was silent for a while."""
    setup = RecordingSetup(packet_loss=0.01, dropouts=(Dropout("foot_r", 14.0, 14.4),))
    return simulate((Stand(4.0), *STROLL, Stand(5.0), *STROLL, Stand(3.0)), seed=4, setup=setup).recording


def work_out(walk: Recording) -> dict[str, object]:
    """Every result file in bytes, analysis.json without run-specific fields."""
    source = SourceFile.of_bytes("walk.parquet", write_recording(walk))
    files: dict[str, object] = dict(analysing.run([source], None, None, lambda stage, share: None))
    notices = files["analysis.json"]
    assert isinstance(notices, bytes)
    return files | {"analysis.json": {k: v for k, v in json.loads(notices).items() if k not in OF_THE_RUN}}


@pytest.mark.sweep
@pytest.mark.parametrize("worn", ["seven", *WORN])
def test_blocks_and_files_change_no_byte_of_a_result(
    walk: Recording, worn: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if worn in WORN:
        stored_by_device = {device: s for device, s in walk.segments.items() if s in WORN[worn]}
        walk = replace(
            walk,
            segments=stored_by_device,
            streams={device: walk.streams[device] for device in stored_by_device},
        )
    whole = work_out(walk)
    samples = len(next(iter(walk.streams.values())).t_s)
    monkeypatch.setattr(held_samples, "SHORT", 100)
    assert held_samples.make_room(101).base is not None
    for rows in (509, samples - 1):  # the second leaves one sample for the last block
        for module in (held_samples, arrays):
            monkeypatch.setattr(module, "AT_A_TIME", rows)
        assert work_out(walk) == whole
