"""Workbook and CSV tables, opened by what they are for; edits count in them."""

from __future__ import annotations

import csv
import io
import json
import zipfile
from dataclasses import replace
from functools import cache
from typing import Any

import openpyxl
import pytest

from core.errors import FormatError, InputError
from core.events.edits import Edit
from core.parameters.catalogue import CATALOGUE
from server.export.content import ExportContent
from server.export.kinds import write_export
from server.report.numbers import numbers_of
from tests.server import analysed
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


def sheet(book: Any, name: str) -> list[dict[str, Any]]:
    header, *rows = book[name].iter_rows(values_only=True)
    return [dict(zip(header, row, strict=True)) for row in rows]


def test_long_and_wide_tables_hold_the_same_numbers_and_every_column_is_explained() -> None:
    content = open_walk()
    found = tables(content)
    wide = {row["cycle"]: row for row in found["strides_wide.csv"]}
    long = found["strides_long.csv"]
    assert len(long) == sum(len(c.values) for c in content.cycles) > 0
    for row in long:
        assert row["value"] == wide[row["cycle"]][row["parameter"]]
        assert row["unit"] == CATALOGUE[row["parameter"]].unit
    explained = {row["name"]: row for row in found["data_dictionary.csv"]}
    asked = {name for n in ("strides_long.csv", "strides_wide.csv", "parameters.csv") for name in found[n][0]}
    asked |= {row["parameter"] for n in ("strides_long.csv", "parameters.csv") for row in found[n]}
    assert asked <= set(explained)
    assert explained["stride_time_s"]["definition"] == CATALOGUE["stride_time_s"].definition


def test_a_stride_that_a_person_left_out_is_told_and_counts_in_no_mean() -> None:
    edit, content = left_out()
    before, after = tables(open_walk()), tables(content)
    rows = [row for row in after["strides_long.csv"] if row["excluded_reason"] == "manual:=stumbled"]
    assert {row["parameter"] for row in rows} == set(content.columns)
    assert {(row["side"], row["counted"]) for row in rows} == {(edit.side, "0")}

    def n(found: dict[str, list[dict[str, str]]]) -> int:
        return next(
            int(r["n"])
            for r in found["parameters.csv"]
            if (r["parameter"], r["side"]) == ("stride_time_s", edit.side)
        )

    assert n(after) == n(before) - 1
    assert {r["what"]: r["value"] for r in after["about.csv"]}["edits"] == "1"


def test_an_angle_that_a_model_gives_is_told_beside_every_value() -> None:
    walk = open_walk()
    estimator = {**(walk.bundle.estimator or {}), "estimated_angles": ["knee_flexion_l"]}
    found = tables(replace(walk, bundle=replace(walk.bundle, estimator=estimator)))
    told = {(r["parameter"], r["side"]) for r in found["strides_long.csv"] if r["estimated"] == "1"}
    assert ("knee_flexion_rom_deg", "left") in told
    assert {(CATALOGUE[n].curve.variable, side) for n, side in told} == {("knee_flexion", "left")}  # type: ignore[union-attr]
    assert {(r["side"], r["estimated_angles"]) for r in found["strides_wide.csv"]} == {
        ("left", "knee_flexion_l"),
        ("right", ""),
    }
    about = {r["what"]: r["value"] for r in found["about.csv"]}
    assert about["estimated_angles"] == "knee_flexion_l"
    assert about["verdict"] == numbers_of(walk.bundle).verdict[1]


def test_levels_from_the_anatomical_zero_are_those_from_standing_plus_what_was_read() -> None:
    walk = open_walk()
    assert not walk.levels
    assert walk.bundle.angles is not None
    read = {"knee_flexion_l": 4.0, "knee_flexion_r": 3.0}
    entered = replace(walk.bundle.angles, standing_deg=read)
    content = replace(walk, bundle=replace(walk.bundle, angles=entered))
    found = tables(content)
    standing, level = "knee_flexion_max_swing_deg", "knee_flexion_max_swing_anatomical_deg"
    for side, zero in (("left", 4.0), ("right", 3.0)):
        for table, value in (("parameters.csv", "mean"), ("strides_long.csv", "value")):
            of = {
                name: [r[value] for r in found[table] if (r["parameter"], r["side"]) == (name, side)]
                for name in (standing, level)
            }
            assert len(of[standing]) == len(of[level]) > 0
            for one, other in zip(of[standing], of[level], strict=True):
                assert (one == "") == (other == "")
                assert one == "" or abs(float(other) - float(one) - zero) < 1e-5
    words = {r["name"]: r for r in found["data_dictionary.csv"]}[level]
    assert words["unit"] == "deg"
    assert words["label"].endswith(", anatomical")
    assert "from the anatomical zero" in words["definition"]
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


@pytest.mark.slow
def test_nothing_that_a_person_typed_becomes_a_formula() -> None:
    _, content = left_out()
    assert {r["what"]: r["value"] for r in tables(content)["about.csv"]}["code"] == "'=HYPERLINK(1)"
    book = openpyxl.load_workbook(io.BytesIO(write_export("xlsx", content)))
    cells = [c for s in book for row in s.iter_rows() for c in row if c.value is not None]
    assert {c.data_type for c in cells} == {"s", "n"}
    assert any(c.value == "=HYPERLINK(1)" for c in cells)


@pytest.mark.slow
def test_the_workbook_holds_the_numbers_of_the_analysis() -> None:
    content = open_walk()
    data = write_export("xlsx", content)
    assert data == write_export("xlsx", open_walk())
    book = openpyxl.load_workbook(io.BytesIO(data))
    assert book.sheetnames == [
        "About",
        "Parameters",
        "Strides",
        "Curves",
        "Contacts",
        "Notices",
        "Dictionary",
    ]
    named = {(r["parameter"], r["side"]): r["mean"] for r in sheet(book, "Parameters")}
    assert named == {
        (p.name, p.side): None if p.mean is None else pytest.approx(p.mean) for p in content.bundle.parameters
    }
    assert [r["cycle"] for r in sheet(book, "Strides")] == [c.number for c in content.cycles]
    curves = sheet(book, "Curves")
    assert len(curves) == 101
    knee = [row["knee_flexion_left_mean_deg"] for row in curves]
    assert 55.0 < max(knee) < 65.0


def test_what_cannot_be_written_says_why() -> None:
    with pytest.raises(InputError, match="choose one of xlsx"):
        write_export("docx", open_walk())
    files = {name: x for name, x in analysed.files().items() if name != "tracks.parquet"}
    edit, _ = left_out()
    with pytest.raises(FormatError, match=r"no tracks\.parquet"):
        open_walk(edit, files=files)
    alone = open_walk(files={"analysis.json": analysed.files()["analysis.json"]})
    assert tables(alone)["strides_long.csv"] == []
