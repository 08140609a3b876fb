"""The contract of every format that names its own sensors: content, SI units, frames, holes, refusals."""

from __future__ import annotations

import resource
from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sagittal.core import rotation
from sagittal.core.errors import FormatError
from sagittal.core.formats import _sniff, text
from sagittal.core.formats.vendors.registry import VENDOR_FORMATS, find_vendor
from sagittal.core.frames import GRAVITY
from tests.core.formats import making
from tests.core.formats import vendor_files as made
from tests.core.formats.vendor_files import VENDOR_SAMPLES
from tests.core.formats.vendor_reading import read, read_parts


@pytest.fixture(scope="module", autouse=True)
def with_h5py() -> None:
    pytest.importorskip("h5py")


@pytest.mark.parametrize("label", VENDOR_SAMPLES)
def test_a_file_is_told_by_its_content_and_read_in_si_units(label: str) -> None:
    name, make = VENDOR_SAMPLES[label]
    data = make()
    knowing = [v.label for v in VENDOR_FORMATS if v.looks_like(text.to_utf8(data))]
    assert knowing == [label.split(",", maxsplit=1)[0]]
    recording = read(data, "renamed.dat" if label != "DeviceMotion JSON" else name)
    for stream in recording.streams.values():
        assert stream.rate_hz == pytest.approx(made.RATE)
        assert stream.t_s == pytest.approx(made.T, abs=1e-6)
        assert stream.acc == pytest.approx(made.ACC, abs=2e-5)
        assert stream.gyr is not None
        assert stream.gyr == pytest.approx(made.GYR, abs=1e-3)
        if stream.quat is not None:
            # the vendor's orientation turns what is measured upright
            np.testing.assert_allclose(rotation.rotate(stream.quat, stream.acc)[:, 2], GRAVITY, atol=1e-3)
    assert not [n for n in recording.notices if n.severity != "info"]


XSENS = making.mt_text(made.ACC, made.GYR).encode()


@pytest.mark.parametrize(
    ("data", "title", "other"),
    [
        (XSENS, "Acc_X", "SampleTimeFine"),
        (made.dot(), "Acc_X", "Quat_W"),
        (made.shimmer(), "Shimmer_952D_Accel_LN_X_CAL", "Shimmer_952D_Accel_WR_X_CAL"),
        (made.apdm_lab(), "Left Foot/Acceleration/X", "Right Foot/Acceleration/X"),
    ],
)
def test_a_column_that_is_there_twice_is_refused_with_both_places(
    data: bytes, title: str, other: str
) -> None:
    with pytest.raises(FormatError) as refused:
        read(data.replace(other.encode(), title.encode(), 1))
    assert refused.value.code == "ambiguous_column"
    assert f"expected one column '{title}', found 2: '{title}#1' (column " in refused.value.message


def test_labels_of_sensors_become_segments() -> None:
    worn = {label: set(read(make()).segments.values()) for label, (_, make) in VENDOR_SAMPLES.items()}
    assert worn == {
        "Movella DOT CSV": {"shank_l"},
        "APDM CSV": {"pelvis", "shank_l"},
        "APDM CSV, Mobility Lab": {"foot_l", "foot_r"},
        "APDM HDF5": {"pelvis", "foot_r"},
        "Xsens MVNX": {"shank_r"},
        "Shimmer Consensys CSV": set(),
        "DeviceMotion JSON": set(),
    }


SCRAPS = (
    b"",
    b"\n",
    b",",
    b"\t",
    b"NaN",
    b"1e400",
    b'"',
    b"<",
    b"&a;",
    b"{",
    b"\0",
    b"\xff",
    b"9" * 400,
    b"-",
    b"/",
)


def damages() -> st.SearchStrategy[list[tuple[float, bool, int, bytes]]]:
    """Where (share of the file, or of its head), how many bytes are replaced, by what."""
    one = st.tuples(
        st.floats(0, 1),
        st.booleans(),
        st.sampled_from((0, 1, 8, 300)),
        st.one_of(st.sampled_from(SCRAPS), st.binary(max_size=8)),
    )
    return st.lists(one, min_size=1, max_size=4)


def damage(data: bytes, changes: list[tuple[float, bool, int, bytes]]) -> bytes:
    out = bytearray(data)
    for share, in_head, cut, new in changes:
        at = int(share * min(len(out), 800 if in_head else len(out)))
        out[at : at + cut] = new
    return bytes(out)


FUZZED: dict[str, Callable[[], dict[str, bytes]]] = {
    label: (lambda name=name, make=make: {name: make()}) for label, (name, make) in VENDOR_SAMPLES.items()
} | {"BIDS motion": made.bids_parts}


MOST_GROWTH_KB = 200_000


@pytest.mark.slow
@pytest.mark.parametrize("label", FUZZED)
def test_damaged_files_are_read_or_refused_within_bounds(label: str) -> None:
    parts = FUZZED[label]()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    @settings(max_examples=20, deadline=2000, derandomize=True, suppress_health_check=list(HealthCheck))
    @given(st.sampled_from(sorted(parts)), damages())
    def read_damaged(which: str, changes: list[tuple[float, bool, int, bytes]]) -> None:
        hurt = {name: damage(data, changes) if name == which else data for name, data in parts.items()}
        with suppress(FormatError):
            read_parts(hurt)

    read_damaged()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_GROWTH_KB


def test_what_is_known_but_not_read_has_an_advice() -> None:
    assert _sniff.sniff(b"DataType=Quaternion\nendheader\ntime\ta\n") == ("known", "OpenSim STO")
    assert "no measurement" in _sniff.advise("OpenSim STO")
    assert find_vendor(b"DataType=Quaternion\nendheader\n") is None
