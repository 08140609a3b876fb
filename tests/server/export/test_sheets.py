"""Export tables read by their target programs, including edits."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from dataclasses import replace
from functools import cache

from sagittal.core.events.edits import Edit
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.server.export.content import ExportContent
from sagittal.server.export.kinds import write_export
from sagittal.server.export.sheets import list_curves, list_cycles, list_events, list_notices
from sagittal.server.report.history.numbers import numbers_of
from tests.server.export.opened import open_walk


@cache
def left_out() -> tuple[Edit, ExportContent]:
    """A person leaves the first counted stride out."""
    first = next(c for c in open_walk().cycles if c.excluded is None)
    edit = Edit("exclude_stride", first.side, (first.start_s + first.end_s) / 2, reason="=stumbled")
    return edit, open_walk(edit)


def tables(content: ExportContent) -> dict[str, list[dict[str, str]]]:
    archive = zipfile.ZipFile(io.BytesIO(write_export("csv", content)))
    return {n: list(csv.DictReader(io.StringIO(archive.read(n).decode()))) for n in archive.namelist()}


def test_long_and_wide_tables_hold_the_same_numbers_and_every_column_is_explained() -> None:
    content = open_walk()
    result = tables(content)
    wide = {row["cycle"]: row for row in result["strides_wide.csv"]}
    long = result["strides_long.csv"]
    assert len(long) == sum(len(c.values) for c in content.cycles) > 0
    for row in long:
        assert row["value"] == wide[row["cycle"]][row["parameter"]]
        assert row["unit"] == CATALOGUE[row["parameter"]].unit
    explained = {row["name"]: row for row in result["data_dictionary.csv"]}
    requested_names = {
        name for n in ("strides_long.csv", "strides_wide.csv", "parameters.csv") for name in result[n][0]
    }
    requested_names |= {row["parameter"] for n in ("strides_long.csv", "parameters.csv") for row in result[n]}
    assert requested_names <= set(explained)
    assert explained["stride_time_s"]["definition"] == CATALOGUE["stride_time_s"].definition


def test_a_stride_that_a_person_left_out_is_told_and_counts_in_no_mean() -> None:
    edit, content = left_out()
    initial_tables, final_tables = tables(open_walk()), tables(content)
    rows = [row for row in final_tables["strides_long.csv"] if row["excluded_reason"] == "manual:=stumbled"]
    assert {row["parameter"] for row in rows} == set(content.columns)
    assert {(row["side"], row["counted"]) for row in rows} == {(edit.side, "0")}

    def n(result: dict[str, list[dict[str, str]]]) -> int:
        return next(
            int(r["n"])
            for r in result["parameters.csv"]
            if (r["parameter"], r["side"]) == ("stride_time_s", edit.side)
        )

    assert n(final_tables) == n(initial_tables) - 1
    assert {r["what"]: r["value"] for r in final_tables["about.csv"]}["edits"] == "1"


def test_an_angle_that_a_model_gives_is_told_beside_every_value() -> None:
    walk = open_walk()
    estimator = {**(walk.bundle.estimator or {}), "estimated_angles": ["knee_flexion_l"]}
    result = tables(replace(walk, bundle=replace(walk.bundle, estimator=estimator)))
    notices = {(r["parameter"], r["side"]) for r in result["strides_long.csv"] if r["estimated"] == "1"}
    assert ("knee_flexion_rom_deg", "left") in notices
    assert {(CATALOGUE[n].curve.variable, side) for n, side in notices} == {("knee_flexion", "left")}  # type: ignore[union-attr]
    assert {(r["side"], r["estimated_angles"]) for r in result["strides_wide.csv"]} == {
        ("left", "knee_flexion_l"),
        ("right", ""),
    }
    about = {r["what"]: r["value"] for r in result["about.csv"]}
    assert about["estimated_angles"] == "knee_flexion_l"
    assert about["verdict"] == numbers_of(walk.bundle).verdict[1]


def test_levels_from_the_anatomical_zero_are_those_from_standing_plus_what_was_read() -> None:
    walk = open_walk()
    assert not walk.levels
    assert walk.bundle.angles is not None
    read = {"knee_flexion_l": 4.0, "knee_flexion_r": 3.0}
    entered = replace(walk.bundle.angles, standing_deg=read)
    content = replace(walk, bundle=replace(walk.bundle, angles=entered))
    result = tables(content)
    standing, level = "knee_flexion_max_swing_deg", "knee_flexion_max_swing_anatomical_deg"
    for side, zero in (("left", 4.0), ("right", 3.0)):
        for table, value in (("parameters.csv", "mean"), ("strides_long.csv", "value")):
            by_name = {
                name: [r[value] for r in result[table] if (r["parameter"], r["side"]) == (name, side)]
                for name in (standing, level)
            }
            assert len(by_name[standing]) == len(by_name[level]) > 0
            for one, second in zip(by_name[standing], by_name[level], strict=True):
                assert (one == "") == (second == "")
                assert one == "" or abs(float(second) - float(one) - zero) < 1e-5
    words = {r["name"]: r for r in result["data_dictionary.csv"]}[level]
    assert words["unit"] == "deg"
    assert words["label"].endswith(", anatomical")
    assert "from neutral (0°)" in words["definition"]
    fhir = json.loads(write_export("fhir", content))
    codes = [e["resource"].get("code", {}).get("coding", [{}])[0].get("code") for e in fhir["entry"]]
    assert codes.count(level) == 2


def test_levels_of_strides_have_the_mean_of_the_take() -> None:
    walk = open_walk()
    assert walk.bundle.angles is not None
    entered = replace(walk.bundle.angles, standing_deg={"knee_flexion_l": 3.0, "hip_flexion_r": -5.0})
    content = replace(walk, bundle=replace(walk.bundle, angles=entered))
    assert {(p.name.split("_")[0], p.side) for p in content.levels} == {("knee", "left"), ("hip", "right")}
    compared = 0
    for p in content.levels:
        own = [c.values.get(p.name) for c in content.cycles if c.side == p.side and c.excluded is None]
        measured = [v for v in own if v is not None]
        if p.mean is not None and len(measured) == p.n:
            assert abs(sum(measured) / len(measured) - p.mean) < 1e-5
            compared += 1
    assert compared >= 3


def test_a_stride_is_a_row_that_says_whether_it_counts() -> None:
    edit, content = left_out()
    table = list_cycles(content)
    assert table.name == "Strides"
    assert len({len(row) for row in (table.header, *table.rows)}) == 1
    rows = [dict(zip(table.header, row, strict=True)) for row in table.rows]
    assert [row["cycle"] for row in rows] == list(range(1, len(content.bundle.strides.strides) + 1))
    assert {(row["counted"], row["excluded_reason"]) for row in rows} == {
        (1, None), (0, "first"), (0, "last"), (0, f"manual:{edit.reason}")
    }  # fmt: skip
    squats = replace(content, bundle=replace(content.bundle, repetitions=()))
    assert list_cycles(squats).name == "Squats"


def test_curves_have_101_rows_and_none_without_angles() -> None:
    walk = open_walk()
    table = list_curves(walk)
    assert [row[0] for row in table.rows] == list(range(101))
    assert "knee_flexion_right_sd_deg" in table.header
    nothing = list_curves(replace(walk, bundle=replace(walk.bundle, angles=None)))
    assert (nothing.header, nothing.rows) == (("pct_cycle",), ())


def test_contacts_and_notices_are_told_as_they_are() -> None:
    walk = open_walk()
    contacts = list_events(walk)
    assert contacts.rows[0] == (
        walk.bundle.events.events[0].time_s, walk.bundle.events.events[0].side, "ic", "foot_contact"
    )  # fmt: skip
    (lost, *_) = (row for row in list_notices(walk).rows if row[1] == "gap")
    assert lost[2:] == ("0.3 s lost.", "pelvis", 1.0)
