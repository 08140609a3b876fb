"""A comparison of filters in words, tables and charts."""

from __future__ import annotations

import csv
import io
from dataclasses import replace

import numpy as np
import pytest

from sagittal.server.report.files.columns import read_table
from sagittal.server.report.files.filter_files import BINS, bin_values, filter_run_files, orientations_parquet
from sagittal.server.report.view.filter_view import view_comparison
from sagittal.server.report.words.filter_list import FILTERS, PROPOSED, list_engines
from tests.server import analysed

FILES = filter_run_files(analysed.comparison())


def test_the_headline_says_what_the_choice_of_a_filter_changes() -> None:
    view = view_comparison(FILES["filters.json"], "cycle")
    assert (
        view.headline
        == "2 filters on 1 sensor: their knee flexion differs by 0.5° left (standard deviation)."
    )
    assert view.sentences[0] == "Magnetometer: not used. Over the gait cycle: 4 left and 0 right strides."
    single_variant = replace(analysed.comparison(), filters=analysed.comparison().filters[:2])
    view = view_comparison(filter_run_files(single_variant)["filters.json"], "cycle")
    assert "there is no other filter to compare with" in view.headline
    assert (view.table, [panels for _, panels in view.groups if panels]) == ((), [])
    assert {row.to_median for row in view.rows} == {("", "")}
    assert view.rows[1].to_own != ("", "")


def test_the_table_names_a_reconstruction_and_why_a_filter_gave_nothing() -> None:
    own, mahony, wu, martin = view_comparison(FILES["filters.json"], "cycle").rows
    assert (own.name, own.cost, own.to_own) == (None, "", ("", ""))
    assert (mahony.engine, mahony.grade, mahony.cost) == ("E1 complementary", "A, exact", "0.25")
    assert mahony.to_median == ("0.4", "0.3")
    assert (wu.label, wu.grade) == ("Wu2018 (reconstruction)", "C, reconstruction")
    assert martin.told == ("Martin2010 needs a magnetometer.",)


def test_stance_and_swing_are_in_table_and_file() -> None:
    view = view_comparison(FILES["filters.json"], "cycle")
    knee, pelvis = view.table
    assert (knee.title, knee.numbers) == ("Knee flexion, left", ("0.5", "0.5", "1.0", "1.0"))
    assert (pelvis.title, pelvis.numbers) == ("Pelvis, heading", ("0.5", "", "", "1.0"))
    rows = list(csv.DictReader(io.StringIO(FILES["spread.csv"].decode())))
    assert [r["swing_sd_deg"] for r in rows] == ["1.0", ""]


def test_orientations_of_every_filter_are_in_one_bounded_table() -> None:
    table, meta = read_table(FILES["orientations.parquet"])
    assert table.column_names == ["t_s", "segment", "filter", "qw", "qx", "qy", "qz"]
    assert meta["sample_step"] == 1
    rows = [r for r in table.to_pylist() if r["filter"] == "Mahony2008"]
    assert {r["segment"] for r in rows} == {"pelvis"}
    assert [r["t_s"] for r in rows] == analysed.comparison().t_s.tolist()
    assert (rows[50]["qw"], rows[50]["qz"]) == pytest.approx((np.cos(0.25), np.sin(0.25)))
    assert rows[-1]["qw"] is None
    thinned, meta = read_table(orientations_parquet(analysed.comparison(), most_rows=100))
    assert thinned.num_rows <= 100
    assert meta["sample_step"] == 4
    assert np.unique(np.diff(thinned.column("t_s").to_numpy()[:20]).round(6)).tolist() == [0.4]


def test_charts_are_over_the_cycle_or_over_time_and_what_has_no_cycle_keeps_its_place_in_time() -> None:
    over = {name: dict(view_comparison(FILES["filters.json"], name).groups) for name in ("cycle", "time")}
    assert [p.title for p in over["cycle"]["Joint angles"]] == ["Knee flexion"]
    assert [p.title for p in over["time"]["Joint angles"]] == ["Pelvic rotation", "Knee flexion"]
    assert 'class="ml"' in over["cycle"]["Joint angles"][0].svg
    assert 'class="mb"' in over["time"]["Heading of segments"][0].svg


def test_curves_over_time_are_bounded_and_keep_what_is_unknown() -> None:
    assert len(bin_values(np.arange(30_001.0), np.nanmean)) <= BINS
    values = np.full(2 * BINS, np.nan)
    values[:3] = (1.0, 3.0, 5.0)
    result = bin_values(values, np.nanmax)
    assert result[:2].tolist() == [3.0, 5.0]
    assert np.isnan(result[2:]).all()


def test_every_filter_is_in_one_engine_and_the_proposal_needs_no_magnetometer() -> None:
    listed = [f for _, _, filters in list_engines() for f in filters]
    assert sorted(f.name for f in listed) == sorted(f.name for f in FILTERS)
    proposed = [f for f in listed if f.name in PROPOSED]
    assert len(proposed) == len(PROPOSED)
    assert {f.engine for f in proposed} == {f.engine for f in listed}
    assert all(f.magnetometer != "needed" for f in proposed)
