"""Tables through a manifest: headers, units, time, and mistakes in the description."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.errors import FormatError, ManifestError
from sagittal.core.formats import manifest_of, read_recording
from sagittal.core.formats.table import open_long_table
from sagittal.core.formats.text import describe_columns, number_columns
from sagittal.core.signals.recording import Recording
from tests.core.formats.making import signals, source

ACC, GYR = signals(300)
CHANNELS = {"acc": ["ax", "ay", "az"], "gyr": ["gx", "gy", "gz"]}
SPEC = {
    "file": "t.csv",
    "rate_hz": 100,
    "acc_unit": "m/s2",
    "gyr_unit": "rad/s",
    "columns": {"shank_l": CHANNELS},
}


def table(separator: str = ",", header: str = "ax,ay,az,gx,gy,gz", extra: str = "") -> str:
    rows = [separator.join(f"{v:.9g}" for v in row) + extra for row in np.hstack([ACC, GYR])]
    return "\n".join([header.replace(",", separator), *rows]) + "\n"


def read(text: str | bytes, **spec: object) -> Recording:
    return read_recording([source("t.csv", text)], manifest_of({"sources": [SPEC | spec]}))


@pytest.mark.parametrize("separator", [",", ";", "\t", "|", " "])
def test_the_separator_is_found(separator: str) -> None:
    stream = read(table(separator)).streams["shank_l"]
    np.testing.assert_allclose(stream.acc, ACC, rtol=1e-8)
    assert (stream.clock, stream.rate_hz) == ("index", 100.0)


@pytest.mark.parametrize("separator", ["\t", " "])
def test_a_separator_of_tab_or_space_may_be_declared(separator: str) -> None:
    stream = read(table(separator), separator=separator).streams["shank_l"]
    np.testing.assert_allclose(stream.acc, ACC, rtol=1e-8)


def test_columns_lined_up_with_several_spaces_are_read() -> None:
    rows = ["".join(f"{v:14.6f}" for v in row) + " " for row in np.hstack([ACC, GYR])]
    stream = read("\n".join(["  ax ay   az gx gy gz", *rows]), separator=" ").streams["shank_l"]
    np.testing.assert_allclose(stream.acc, ACC, atol=1e-6)


def test_times_that_hardly_differ_give_no_endless_rate() -> None:
    rows = [f"{i * 5e-324},{row}" for i, row in enumerate(table().split("\n")[1:-1])]
    text = "\n".join(["t,ax,ay,az,gx,gy,gz", *rows])
    with pytest.raises(FormatError) as e:
        read(text, rate_hz=None, time_column="t")
    assert e.value.code == "time_constant"


COUNTER = {"rate_hz": None, "counter": {"column": "n", "rate_hz": 100}}


def counted(counts: np.ndarray, rows: np.ndarray | None = None) -> str:
    text = table().split("\n")
    kept = text[1:-1] if rows is None else [text[1 + i] for i in rows]
    lines = [f"{n:g},{row}" for n, row in zip(counts, kept, strict=True)]
    return "\n".join(["n," + text[0], *lines]) + "\n"


def test_lost_rows_of_a_counted_table_are_lost_time() -> None:
    there = np.setdiff1d(np.arange(300), np.r_[50:55, 200:260])
    stream = read(counted(there, there), **COUNTER).streams["shank_l"]
    assert (stream.clock, stream.rate_hz) == ("counter", 100.0)
    np.testing.assert_allclose(stream.t_s, there / 100, atol=1e-9)
    np.testing.assert_allclose(stream.acc, ACC[there], rtol=1e-8)


@pytest.mark.parametrize(("wrap", "start"), [(256, 200), (None, 65_500), (65_536, 65_400)])
def test_the_counter_of_a_table_wraps(wrap: int | None, start: int) -> None:
    counts = (start + np.arange(300)) % (wrap or 65_536)
    counter = {"column": "n", "rate_hz": 100, "wrap": wrap} if wrap else COUNTER["counter"]
    stream = read(counted(counts), rate_hz=None, counter=counter).streams["shank_l"]
    np.testing.assert_allclose(stream.t_s, np.arange(300) / 100, atol=1e-9)


def test_tables_that_share_a_counter_share_the_time() -> None:
    files = [
        source("l.csv", counted(np.arange(65_530, 65_830) % 65_536)),
        source("r.csv", counted(np.arange(4, 304))),
    ]
    entry = SPEC | COUNTER
    other = entry | {"file": "r.csv", "columns": {"shank_r": CHANNELS}}
    streams = read_recording(files, manifest_of({"sources": [entry | {"file": "l.csv"}, other]})).streams
    assert streams["shank_l"].t_s[0] == 0.0
    assert streams["shank_r"].t_s[0] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("included", "counter", "code", "words"),
    [
        (np.arange(300) * 2, {}, "bad_counter", "'n' goes up by 2 from row to row, expected 1"),
        (np.arange(300), {"wrap": 256}, "bad_counter", "counts to 299, but counter.wrap is 256"),
        (np.arange(300), {"wrap": 2}, "manifest_bad_value", "counter.wrap is 2"),
        (np.arange(300), {"column": "N"}, "unknown_column", "counter.column: t.csv has no column 'N'"),
        (np.arange(300), {"rate_hz": None}, "rate_missing", "counter.rate_hz is missing"),
        (np.arange(300), {"rate_hz": 0.0}, "manifest_bad_value", "counter.rate_hz is 0"),
        (np.arange(300), {"per_second": 3}, "manifest_unknown_key", "sources[0].counter.per_second"),
    ],
)
def test_a_column_that_does_not_count_samples_is_said(
    counts: np.ndarray, counter: dict[str, object], code: str, words: str
) -> None:
    entry = {"rate_hz": None, "counter": {"column": "n", "rate_hz": 100} | counter}
    with pytest.raises((FormatError, ManifestError)) as e:
        read(counted(counts), **entry)
    assert e.value.code == code
    assert words in e.value.message


@pytest.mark.parametrize("more", [{"time_column": "n"}, {"rate_hz": 50}])
def test_two_clocks_for_one_table_are_refused(more: dict[str, object]) -> None:
    with pytest.raises(ManifestError) as e:
        read(counted(np.arange(300)), **(COUNTER | more))
    assert e.value.code == "manifest_bad_value"
    assert "give one of them" in e.value.message


def test_lines_before_the_header_and_its_absence_are_described() -> None:
    lines = ["comment", "more, of, it", *table().split("\n")]
    np.testing.assert_allclose(read("\n".join(lines), skip_rows=2).streams["shank_l"].acc, ACC, rtol=1e-8)
    numbered = {"shank_l": {"acc": ["1", "2", "3"], "gyr": ["4", "5", "6"]}}
    bare = table().split("\n", 1)[1]
    np.testing.assert_allclose(
        read(bare, header_rows=0, columns=numbered).streams["shank_l"].acc, ACC, rtol=1e-8
    )


def test_units_are_converted() -> None:
    stream = read(table(), acc_unit="g", gyr_unit="deg/s").streams["shank_l"]
    assert stream.gyr is not None
    np.testing.assert_allclose(stream.acc, ACC * 9.80665, rtol=1e-8)
    np.testing.assert_allclose(stream.gyr, np.radians(GYR), rtol=1e-8)


def test_a_time_column_makes_the_clock() -> None:
    t = 1.7e12 + np.arange(300) * 10.0
    rows = [f"{a:.1f}," + row for a, row in zip(t, table().split("\n")[1:], strict=False)]
    text = "time,ax,ay,az,gx,gy,gz\n" + "\n".join(rows)
    stream = read(text, time_column="time", time_unit="ms", rate_hz=None).streams["shank_l"]
    assert stream.clock == "device"
    assert stream.rate_hz == pytest.approx(100.0)
    np.testing.assert_allclose(stream.t_s, np.arange(300) / 100, atol=1e-6)


def test_quaternions_come_scalar_first_whatever_the_file_has() -> None:
    rows = [row + ",0.1,0.2,0.3,0.9" for row in table().split("\n")[1:-1]]
    text = "ax,ay,az,gx,gy,gz,qx,qy,qz,qw\n" + "\n".join(rows)
    columns = {"shank_l": CHANNELS | {"quat": ["qx", "qy", "qz", "qw"]}}
    stream = read(text, columns=columns, quat_order="xyzw").streams["shank_l"]
    assert stream.quat is not None
    np.testing.assert_allclose(stream.quat[0], [0.9, 0.1, 0.2, 0.3])


def test_removed_gravity_is_an_error_notice() -> None:
    notices = read(table(), gravity_included=False).streams["shank_l"].notices
    assert [(n.code, n.severity) for n in notices] == [("gravity_removed", "error")]


def test_columns_named_by_segment_map_themselves_others_wait() -> None:
    assert dict(read(table()).segments) == {"shank_l": "shank_l"}
    assert dict(read(table(), columns={"box 7": CHANNELS}).segments) == {}


@pytest.mark.parametrize(
    ("change", "code", "word"),
    [
        ({"acc_unit": None}, "unit_missing", "acc_unit"),
        ({"gyr_unit": None}, "unit_missing", "gyr_unit"),
        ({"rate_hz": None}, "rate_missing", "rate_hz"),
        ({"columns": {"s": CHANNELS | {"acc": ["ax", "ay", "acz"]}}}, "unknown_column", "did you mean 'az'"),
        ({"columns": {"s": CHANNELS | {"mag": ["a", "b", "mmmm"]}}}, "unknown_column", "columns.s.mag"),
        ({"time_column": "when"}, "unknown_column", "time_column"),
        (
            {"columns": {"s": CHANNELS | {"quat": ["ax", "ay", "az", "gx"]}}},
            "manifest_bad_value",
            "quat_order",
        ),
    ],
)
def test_a_description_that_does_not_fit_is_refused(change: dict[str, object], code: str, word: str) -> None:
    with pytest.raises(ManifestError) as e:
        read(table(), **change)
    assert e.value.code == code
    assert word in e.value.message


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("ax,ay,az,gx,gy,gz\n", "empty"),
        ("ax,ay,az,gx,gy,gz\n" + ",,,,,\n" * 20, "missing_acc"),
    ],
)
def test_a_table_without_numbers_is_refused(text: str, code: str) -> None:
    with pytest.raises(FormatError) as e:
        read(text)
    assert e.value.code == code


def test_a_short_last_line_is_left_out_and_said() -> None:
    stream = read(table()[:-25]).streams["shank_l"]
    assert len(stream.t_s) == 299
    assert [(n.code, n.severity) for n in stream.notices] == [("truncated_line", "info")]


def test_words_in_the_table_count_as_missing() -> None:
    lines = table().split("\n")
    lines[5] = "ERR" + lines[5][lines[5].index(",") :]
    lines[6] = "inf" + lines[6][lines[6].index(",") :]
    stream = read("\n".join(lines)).streams["shank_l"]
    assert np.isnan(stream.acc).sum() == 2
    assert [n.code for n in stream.notices] == ["bad_cells"]


DELSYS = "X [s],EMG,X [s],ax,X [s],ay,az,gx,gy,gz,m,m"


def delsys() -> str:
    """A clock before several channels; the first one, at another rate, is that of the EMG."""
    emg, imu = 0.004 * np.arange(300), 0.01 * np.arange(300)
    columns = [emg, ACC[:, 0], imu, ACC[:, 0], imu, *ACC[:, 1:].T, *GYR.T, imu, -imu]
    rows = [",".join(f"{v:.9g}" for v in row) for row in np.stack(columns, axis=1)]
    return "\n".join([DELSYS, *rows]) + "\n"


@pytest.mark.parametrize(
    ("spec", "path"),
    [
        ({"time_column": "X [s]"}, "time_column"),
        ({"counter": {"column": "X [s]"}}, "counter.column"),
        ({"columns": {"shank_l": {**CHANNELS, "acc": ["ax", "X [s]", "az"]}}}, "columns.shank_l.acc"),
        ({"columns": {"shank_l": {**CHANNELS, "gyr": ["X [s]", "gy", "gz"]}}}, "columns.shank_l.gyr"),
        ({"columns": {"shank_l": {**CHANNELS, "mag": ["ax", "ay", "X [s]"]}}}, "columns.shank_l.mag"),
        (
            {"columns": {"shank_l": {**CHANNELS, "quat": ["ax", "ay", "az", "X [s]"]}}, "quat_order": "wxyz"},
            "columns.shank_l.quat",
        ),
    ],
)
def test_a_title_of_several_columns_is_refused_with_the_list(spec: dict[str, object], path: str) -> None:
    with pytest.raises(ManifestError) as caught:
        read(delsys(), **spec)
    assert caught.value.code == "ambiguous_column"
    assert caught.value.message == (
        f"{path}: expected the name of one column, but 3 columns of t.csv are called 'X [s]'. Give one of "
        "these names: 'X [s]#1' (column 1, before 'EMG'), 'X [s]#2' (column 3, between 'EMG' and 'ax'), "
        "'X [s]#3' (column 5, between 'ax' and 'ay')."
    )


@pytest.mark.parametrize(("column", "rate"), [("X [s]#1", 250.0), ("X [s]#2", 100.0), ("X [s]#3", 100.0)])
def test_a_numbered_name_chooses_one_of_them(column: str, rate: float) -> None:
    stream = read(delsys(), rate_hz=None, time_column=column).streams["shank_l"]
    assert stream.rate_hz == pytest.approx(rate)
    np.testing.assert_allclose(stream.acc, ACC, rtol=1e-8)


@pytest.mark.parametrize("spec", [{"time_column": "X [s]#2", "rate_hz": None}, {}])
def test_sensors_that_end_before_the_file_have_no_hole_at_the_end(spec: dict[str, object]) -> None:
    longer = "".join(f"{1.2 + 0.004 * i:.3f},{i},,,,,,,,,,\n" for i in range(200))
    stream = read(delsys() + longer, **spec).streams["shank_l"]
    assert stream.rate_hz == pytest.approx(100.0)
    assert len(stream.t_s) == 300
    assert not stream.notices


def test_a_row_without_time_leaves_the_rate_known() -> None:
    lines = delsys().splitlines()
    lines[50] = ",".join("" if i == 2 else cell for i, cell in enumerate(lines[50].split(",")))
    stream = read("\n".join(lines), rate_hz=None, time_column="X [s]#2").streams["shank_l"]
    assert stream.rate_hz == pytest.approx(100.0)
    assert [n.code for n in stream.notices] == ["stamps_missing"]
    assert len(stream.t_s) == 300


def test_titles_that_nobody_asks_for_may_repeat() -> None:
    stream = read(delsys()).streams["shank_l"]
    np.testing.assert_allclose(stream.acc, ACC, rtol=1e-8)


def test_a_long_table_refuses_a_repeated_title_as_well() -> None:
    spec = manifest_of({"sources": [{**SPEC, "rate_hz": None, "time_column": "X [s]"}]}).sources[0]
    with pytest.raises(ManifestError, match=r"3 columns of t\.csv are called"):
        open_long_table(source("t.csv", delsys()), spec)


@pytest.mark.parametrize(
    ("titles", "names"),
    [
        (["a", "b"], ["a", "b"]),
        (["a", "", "a"], ["a#1", "column 2", "a#2"]),
        (["a", "a", "a#1"], ["a#1#", "a#2", "a#1"]),
        (["", "column 1"], ["column 1#1", "column 1#2"]),
    ],
)
def test_every_column_has_a_name_of_its_own(titles: list[str], names: list[str]) -> None:
    assert number_columns(titles) == names


def test_of_many_columns_some_are_listed() -> None:
    listed = describe_columns(["t"] * 30, "t")
    assert listed.count("'t#") > 20
    assert listed.endswith("and 10 more")
