"""The contract of every format that names its own sensors: content, SI units, frames, holes, refusals."""

from __future__ import annotations

import re
import resource
import sys
from collections.abc import Callable
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from core import rotation
from core.errors import FormatError, InputError
from core.formats import SourceFile, _sniff, parse_manifest, read_recording, text
from core.formats.vendors import VENDOR_FORMATS, find_vendor
from core.frames import GRAVITY
from core.recording import ImuStream, Recording
from tests.core.formats import making
from tests.core.formats import vendor_files as made
from tests.core.formats.vendor_files import VENDOR_SAMPLES
from tests.data import data_folder


def read(data: bytes, name: str = "x.bin") -> Recording:
    return read_recording([SourceFile.of_bytes(name, data)])


def only(recording: Recording) -> ImuStream:
    return next(iter(recording.streams.values()))


def code_of(data: bytes, name: str = "x.bin") -> str:
    with pytest.raises(InputError) as refused:
        read(data, name)
    assert len(refused.value.message.split()) > 6
    return refused.value.code


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


def test_two_monitors_of_one_label_are_refused() -> None:
    assert code_of(made.apdm_studio().replace(b"Left Ankle", b"Lumbar")) == "ambiguous_column"


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


def test_dot_clocks_that_wrap_between_two_sensors_are_one_axis() -> None:
    late = made.dot(start_us=500).replace(b"L_shank", b"R_shank")
    files = [SourceFile.of_bytes("a", made.dot(start_us=2**32 - 20_000)), SourceFile.of_bytes("b", late)]
    left, right = read_recording(files).streams.values()
    assert right.t_s[0] - left.t_s[0] == pytest.approx(0.0205)
    rows = made.dot().split(b"\n")
    with_hole = b"\n".join(rows[:60] + rows[80:])
    assert np.diff(only(read(with_hole)).t_s).max() == pytest.approx(0.21)


def test_dot_files_say_what_they_lack() -> None:
    (notice,) = only(read(made.dot(head="Unsynced"))).notices
    assert notice.code == "not_synchronised"
    assert code_of(made.dot().replace(b"Acc_", b"FreeAcc_")) == "gravity_removed"
    assert code_of(made.dot().replace(b"Acc_", b"dv_")) == "missing_acc"
    assert "missing_gyro" in {n.code for n in only(read(made.dot().replace(b"Gyr_", b"dq_"))).notices}
    factory = made.dot().replace(b"L_shank", b"Xsens DOT")
    assert list(read(factory, "D4-22-CD-00_left foot.csv").streams) == ["D4-22-CD-00_left foot"]


def test_apdm_files_in_other_units_or_versions_are_refused() -> None:
    assert code_of(made.apdm_lab(unit="deg/s")) == "unknown_unit"
    assert code_of(made.apdm_h5(version=3)) == "unsupported_format"
    assert code_of(made.apdm_h5(link=True)) == "bad_hdf5"


def test_without_h5py_the_answer_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    data = made.apdm_h5()
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(FormatError, match="sagittal\\[apdm\\]") as refused:
        read(data)
    assert refused.value.code == "reader_missing"


def test_mvnx_with_entities_is_refused_and_lost_frames_are_holes() -> None:
    bomb = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>\n'
    assert code_of(made.mvnx(head=bomb)) == "bad_xml"
    assert code_of(made.mvnx().replace(b"UTF-8", b"no-such-code")) == "bad_xml"
    assert code_of(made.mvnx()[:-9]) == "bad_xml"
    assert code_of(made.mvnx().replace(b"sensorFreeAcceleration", b"acceleration")) == "missing_acc"
    stream = only(read(made.mvnx(skip=(50, 51))))
    assert len(stream.t_s) == made.N - 2
    assert np.diff(stream.t_s).max() == pytest.approx(0.03)
    assert stream.gyr == pytest.approx(made.GYR[2:], abs=1e-3)
    empty = re.sub(rb"(<sensorMagneticField>).*?(</sensorMagneticField>)", rb"\1\2", made.mvnx())
    assert len(only(read(empty)).t_s) == made.N
    moved = re.sub(
        rb"( \S+)(</sensorFreeAcceleration><sensorMagneticField>)", rb"\2\1 ", made.mvnx(), count=3
    )
    assert len(only(read(moved)).t_s) == made.N - 3


def test_shimmer_reads_the_accelerometer_that_does_not_clip() -> None:
    clipped = np.clip(made.ACC * 3, -2 * GRAVITY, 2 * GRAVITY)
    stream = only(read(made.shimmer(acc=clipped)))
    assert stream.acc == pytest.approx(made.ACC, abs=1e-6)
    assert [n.code for n in stream.notices] == ["wide_range_read"]
    assert code_of(made.shimmer(unit="no_units")) == "unknown_unit"
    assert code_of(made.shimmer(kind="RAW")) == "missing_acc"


def test_a_row_of_units_says_what_the_time_is_in_or_the_file_is_refused() -> None:
    lab = made.apdm_lab()
    assert np.diff(only(read(lab)).t_s) == pytest.approx(1.0 / made.RATE)
    fast = only(read(lab.replace(b"\ns,m/s^2", b"\nms,m/s^2"))).t_s
    assert np.diff(fast) == pytest.approx(1e-3 / made.RATE)
    assert code_of(lab.replace(b"\ns,m/s^2", b"\nframes,m/s^2")) == "unknown_unit"
    assert code_of(lab.replace(b"\ns,m/s^2", b"\nms,g")) == "unknown_unit"
    assert code_of(made.shimmer().replace(b"\nms\t", b"\nticks\t")) == "unknown_unit"


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


def bids(parts: dict[str, bytes]) -> Recording:
    return read_recording([SourceFile.of_bytes(name, data) for name, data in parts.items()])


def test_bids_tables_are_read_by_the_files_beside_them() -> None:
    recording = bids(made.bids_parts())
    assert dict(recording.segments) == {"LeftFoot": "foot_l", "Lumbar": "pelvis"}
    stream = recording.streams["Lumbar"]
    assert stream.rate_hz == made.RATE
    assert stream.acc == pytest.approx(made.ACC, abs=1e-6)
    assert stream.gyr == pytest.approx(made.GYR, abs=1e-6)
    assert len(recording.sha256) == 3
    assert not recording.notices
    for parts, code in (
        (made.bids_parts(types=("POS", "ORNT")), "missing_acc"),
        (made.bids_parts(acc_unit="furlong"), "unknown_unit"),
        (
            {
                n: d.replace(b"\t", b"\t0\t") if "_motion.tsv" in n else d
                for n, d in made.bids_parts().items()
            },
            "bad_table",
        ),
        (
            {n: d.replace(b"Lumbar\t", b"LeftFoot\t") for n, d in made.bids_parts().items()},
            "ambiguous_column",
        ),
        (
            {n: re.sub(rb"\t[yz]\tGYRO", b"\tn/a\tLATENCY", d) for n, d in made.bids_parts().items()},
            "ambiguous_column",
        ),
    ):
        with pytest.raises(FormatError) as refused:
            bids(parts)
        assert refused.value.code == code


@pytest.mark.recorded
def test_a_real_bids_recording_of_positions_says_so() -> None:
    folder = data_folder("formats", "bids_motion")
    parts = {p.name: p.read_bytes() for p in folder.iterdir()}
    stem = next(name for name in parts if name.endswith("_channels.tsv")).removesuffix("_channels.tsv")
    with pytest.raises(FormatError, match="POS") as refused:
        bids({**parts, f"{stem}_motion.tsv": b"0\t0\t0\t0\t0\t0\t1\t0\n" * 50})
    assert refused.value.code == "missing_acc"


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
            bids(hurt)

    read_damaged()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < MOST_GROWTH_KB


def test_what_is_known_but_not_read_has_an_advice() -> None:
    assert _sniff.sniff(b"DataType=Quaternion\nendheader\ntime\ta\n") == ("known", "OpenSim STO")
    assert "no measurement" in _sniff.advise("OpenSim STO")
    assert find_vendor(b"DataType=Quaternion\nendheader\n") is None
