from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.formats.common_time import finish
from sagittal.core.formats.vendors import xsens
from sagittal.core.simulate import RecordingSetup, Simulation, Stand, Straight, mt_files, mt_text, simulate


@pytest.fixture(scope="module")
def lossy() -> Simulation:
    return simulate(
        (Stand(2.0), Straight(3.0, 0.6, 0.54), Stand(1.0)),
        seed=9,
        setup=RecordingSetup(packet_loss=0.03, rate_hz=60.0),
    )


def test_files_read_back_as_the_recording(lossy: Simulation) -> None:
    files = mt_files(lossy.recording, "walk-000", first_counter=65_500)
    assert set(files) == {f"walk-000_{d}.txt" for d in lossy.recording.streams}
    back = finish([xsens.read(data, name) for name, data in files.items()])
    assert set(back) == set(lossy.recording.streams)
    for device, stream in lossy.recording.streams.items():
        second = back[device]
        assert second.rate_hz == 60.0
        assert second.t_s == pytest.approx(stream.t_s, abs=1e-9), "counter wraps and gaps keep their time"
        for a, b in ((second.acc, stream.acc), (second.gyr, stream.gyr), (second.mag, stream.mag)):
            assert a is not None
            assert b is not None
            assert np.abs(a - b).max() <= 0.5e-6 + 1e-12


def test_the_text_looks_like_mt_manager(lossy: Simulation) -> None:
    stream = next(iter(lossy.recording.streams.values()))
    lines = mt_text(stream, first_counter=7).splitlines()
    header = next(i for i, line in enumerate(lines) if not line.startswith("//"))
    assert "// Update Rate: 60.0Hz" in lines[:header]
    assert lines[header].split("\t")[:3] == ["PacketCounter", "SampleTimeFine", "Acc_X"]
    first = lines[header + 1].split("\t")
    assert first[:2] == ["00007", ""]
    assert len(first) == 11
    assert len(lines) - header - 1 == len(stream.t_s)
