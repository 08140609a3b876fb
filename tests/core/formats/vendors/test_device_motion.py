"""A phone's events: which axis is which, what is assumed, and what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats import SourceFile, parse_manifest, read_recording
from sagittal.core.formats.source_spec import SourceSpec
from sagittal.core.formats.vendors import device_motion
from tests.core.formats import vendor_files as made
from tests.core.formats.vendor_reading import only, read


def test_a_phones_rates_are_read_as_gravity_turns() -> None:
    for order, listed in (((0, 1, 2), True), ((2, 0, 1), False)):
        stream = only(read(made.phone(order=order, listed=listed)))
        assert stream.gyr == pytest.approx(made.GYR, abs=1e-6)
        assert [n.code for n in stream.notices] == ["sign_assumed"]
    still = made.phone().replace(f'"beta": {np.degrees(made.TURN)}'.encode(), b'"beta": 0.0')
    assert [n.code for n in only(read(still)).notices] == ["sign_assumed", "axes_assumed"]


def test_a_phone_whose_sign_was_declared_is_read_so_and_nothing_is_assumed() -> None:
    said = only(read(made.phone())).notices[0].message
    declared = said[said.index("{") : said.rindex("}") + 1].encode()
    files = [SourceFile.of_bytes("x.bin", made.phone())]
    stream = read_recording(files, parse_manifest(declared)).streams["x"]
    assert stream.acc == pytest.approx(-made.ACC, abs=1e-6)
    assert not stream.notices


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"{", "bad_json"),
        (b'{"events": 5}', "bad_json"),
        (b"[1, 2]", "bad_json"),
        (b"[]", "empty"),
        (b'[{"accelerationIncludingGravity": {"x": 1, "y": 2, "z": 3}}]', "no_time"),
    ],
)
def test_what_holds_no_events_is_refused(data: bytes, code: str) -> None:
    with pytest.raises(FormatError) as refused:
        device_motion.read(data, "phone.json")
    assert refused.value.code == code


def test_the_first_clock_that_runs_is_read_and_holes_stay_holes() -> None:
    events = json.loads(made.phone(listed=True))
    for e in events:
        e["timeStamp"] = e["t_ms"] + 5000.0
        e["t_ms"] = None
    events[3]["rotationRate"] = None
    events[4]["accelerationIncludingGravity"] = {"x": 1e300, "y": 0.0, "z": 0.0}
    (draft,) = device_motion.read(json.dumps(events).encode(), "left foot.json")
    assert draft.ticks == pytest.approx(made.T + 5.0)
    assert draft.segment == "foot_l"
    assert draft.gyr is not None
    assert np.isnan(draft.gyr[3]).all()
    assert np.isnan(draft.acc[4, 0])


def test_a_declared_unit_of_the_rates_goes_before_the_usual_one() -> None:
    spec = SourceSpec(file="phone.json", gyr_unit="rad/s", rate_hz=60.0)
    (draft,) = device_motion.read(made.phone(), "phone.json", spec)
    assert draft.gyr is not None
    assert draft.gyr[0] == pytest.approx(np.degrees(made.GYR[0]))
    assert draft.rate_hz == 60.0


def test_events_are_told_by_the_name_of_their_acceleration() -> None:
    assert device_motion.looks_like(made.phone(listed=True))
    assert not device_motion.looks_like(b'{"events": []}')
    assert not device_motion.looks_like(b"x" + made.phone())
