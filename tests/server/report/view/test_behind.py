"""Details of a parameter."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest

from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.server.report.files.bundle import read_columns
from sagittal.server.report.files.exports import strides_csv
from sagittal.server.report.view.behind import open_row
from sagittal.server.report.view.level import level_column
from sagittal.server.report.view.model import report_model
from tests.server import walk
from tests.server.report.conftest import MakeBundle


def test_every_parameter_of_the_table_is_defined_in_a_sentence() -> None:
    definitions = [entry.definition for entry in CATALOGUE.values()]
    assert all(text[0].isupper() or text[0].isdigit() for text in definitions)
    assert all(text.endswith(".") for text in definitions)


def test_a_number_is_the_mean_of_the_strides_it_opens_to(make_bundle: MakeBundle) -> None:
    bundle = make_bundle()
    rows = {r.name: r for _, group in report_model(bundle).groups for r in group}
    column = tuple(s.end_s - s.start_s for s in bundle.strides.strides)
    number = open_row(rows["stride_time_s"], bundle.strides, column, 12.0)
    values = [s.value for s in number.strides if s.counted and s.side == "left" and s.value is not None]
    assert rows["stride_time_s"].left is not None
    assert sum(values) / len(values) == pytest.approx(rows["stride_time_s"].left.value)
    assert rows["stride_time_s"].left.n == len(values)
    left_out = [s for s in number.strides if not s.counted]
    assert left_out
    assert all(s.excluded for s in left_out)
    assert number.svg.count("<circle") == len(number.strides)
    # a picture (role=img) must hold nothing to operate
    assert 'role="group"' in number.svg
    assert 'role="img"' not in number.svg
    assert number.svg.count('href="timeline#t=') == len(number.strides)


@pytest.mark.parametrize("values", [(59.9, 45.6), (0.512, 0.498), (101.3, 101.3), (-3.2, 11.7)])
def test_the_axis_of_the_strides_has_round_ticks(
    make_bundle: MakeBundle, values: tuple[float, float]
) -> None:
    bundle = make_bundle()
    rows = {r.name: r for _, group in report_model(bundle).groups for r in group}
    row = replace(rows["stride_time_s"], norm_mean=None, norm_sd=None)
    column = tuple(values[i % 2] for i in range(len(bundle.strides.strides)))
    svg = open_row(row, bundle.strides, column, 12.0).svg
    labels = [x.replace("−", "-") for x in re.findall(r'text-anchor="end">([^<]+)<', svg)]
    ticks = [float(x) for x in labels]
    step = ticks[1] - ticks[0]
    assert f"{step:e}"[:2] in ("1.", "2.", "5."), labels
    assert all(abs(t / step - round(t / step)) < 1e-6 for t in ticks), labels
    assert ticks == pytest.approx([ticks[0] + i * step for i in range(len(ticks))])


def test_a_figure_of_the_take_has_no_strides(make_bundle: MakeBundle) -> None:
    bundle = make_bundle()
    rows = {r.name: r for _, group in report_model(bundle).groups for r in group}
    number = open_row(rows["cadence_spm"], bundle.strides, None, 12.0)
    assert (number.strides, number.svg) == ((), "")
    assert number.to_json()["definition"] == CATALOGUE["cadence_spm"].definition


def test_columns_come_back_from_the_stride_table() -> None:
    strides = walk.strides()
    column = tuple(None if i == 2 else float(i) for i in range(len(strides.strides)))
    back = read_columns(strides_csv(strides, {"stride_length_m": column}))
    assert back == {"stride_length_m": column}


def test_an_anatomical_angle_opens_to_its_strides_shifted_by_the_goniometer(make_bundle: MakeBundle) -> None:
    strides = make_bundle().strides
    column = tuple(float(i) for i in range(len(strides.strides)))
    columns = {"knee_flexion_ic_deg": column}
    result = level_column("knee_flexion_ic_anatomical_deg", strides, columns, {"knee_flexion_l": 8.0})
    assert result is not None
    for s, was, now in zip(strides.strides, column, result, strict=True):
        assert now == (was + 8.0 if s.side == "left" else None)
    assert level_column("cadence_spm", strides, columns, {}) is None
