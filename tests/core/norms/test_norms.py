"""Reference tables: complete, attributed, and correct on comparability."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files
from itertools import pairwise

import numpy as np
import pytest

from sagittal.core.frames import SIDES, Floats
from sagittal.core.norms import (
    adult_kinematics,
    angle_values,
    look_up_norms,
    predict_at_speed,
    temporal_values,
)
from sagittal.core.norms.tables import read_rows
from sagittal.core.norms.values import COARSE_S
from sagittal.core.parameters.catalogue import CATALOGUE, list_curve_figures
from tests.data import data_folder
from tests.helpers.wbds import people

TABLES = (
    "kinematics_wbds_adult", "kinematic_parameters_wbds", "gps_reference_wbds", "spatiotemporal_age_sex",
    "spatiotemporal_speed_regression_h2a",
)  # fmt: skip

BY_SPEED = (
    "norm_speed_matched_adult", "speed_model_coefficients", "spatiotemporal_speed_model_rehazenter52",
    "spatiotemporal_by_speed_bin_rehazenter52", "discrete_model_rehazenter52",
    "discrete_mean_of_peaks_by_speed",
)  # fmt: skip


@pytest.mark.recorded
@pytest.mark.parametrize("name", [*TABLES, *(f"speed/{name}" for name in BY_SPEED)])
def test_every_table_is_shipped_as_prepared_and_its_origin_written_down(name: str) -> None:
    own = name.removeprefix("speed/")
    shipped = files("sagittal.core.norms").joinpath("data", f"{own}.csv").read_bytes()
    sources = files("sagittal.core.norms").joinpath("data", "SOURCES.md").read_text(encoding="utf-8")
    assert f"| {own}.csv |" in sources
    assert shipped == (data_folder("norms") / f"{name}.csv").read_bytes()


def test_nothing_else_is_shipped() -> None:
    shipped = {p.name for p in files("sagittal.core.norms").joinpath("data").iterdir()}
    own = {"gps_sagittal_wbds.csv", "SOURCES.md"}
    assert shipped == {f"{name}.csv" for name in (*TABLES, *BY_SPEED)} | own


def test_the_adult_knee_is_the_published_one() -> None:
    """Every tenth percent as computed from the strides when the table was made."""
    band = adult_kinematics(None).bands["knee_flexion"]
    printed = [2.2, 13.2, 9.6, 3.7, 1.5, 7.9, 33.6, 59.9, 48.7, 11.5, 1.4]
    assert np.round(band.mean_deg[::10], 1) == pytest.approx(printed, abs=0.051)
    assert (band.n, band.group) == (42, "adult_21_84")
    assert "Fukuchi" in band.source
    assert "CC BY 4.0" in band.source


@pytest.mark.parametrize(
    ("age", "group", "n"),
    [(None, "adult_21_84", 42), (18, "adult_21_84", 42), (21, "adult_21_54", 25), (54.9, "adult_21_54", 25),
     (55, "adult_55_84", 17), (93, "adult_55_84", 17)],
)  # fmt: skip
def test_the_age_chooses_the_group(age: float | None, group: str, n: int) -> None:
    result = adult_kinematics(age)
    assert result.reason is None
    for band in result.bands.values():
        assert (band.group, band.n) == (group, n)
        assert band.mean_deg.shape == band.sd_deg.shape == (101,)
        assert np.isfinite(band.mean_deg).all()
        assert (band.sd_deg > 0).all()
        with pytest.raises(ValueError, match="read-only"):
            band.mean_deg[0] = 0.0


def test_no_band_where_no_reference_exists() -> None:
    child = adult_kinematics(12)
    assert (dict(child.bands), child.reason) == ({}, "no_norm_for_age")
    assert angle_values(12).reason == "no_norm_for_age"


def test_every_band_says_its_zero_and_how_far_to_trust_it() -> None:
    bands = adult_kinematics(None).bands
    assert {b.zero for b in bands.values()} == {"anatomical"}
    assert {v for v, b in bands.items() if b.confidence == "normal"} == {
        "hip_flexion", "knee_flexion", "ankle_dorsiflexion",
    }  # fmt: skip
    assert all(b.note for b in bands.values())


def test_angle_references_exist_for_our_angle_parameters_and_only_ranges_compare() -> None:
    values = angle_values(30).values
    known_names = {name for name in list_curve_figures() if CATALOGUE[name].norm is not None}
    assert set(values) == {*known_names, "pelvis_obliquity_max_swing_deg"}
    assert {n for n, v in values.items() if v.comparable} == {
        "hip_flexion_rom_deg", "knee_flexion_rom_deg", "ankle_dorsiflexion_rom_deg",
    }  # fmt: skip
    assert values["knee_flexion_max_swing_deg"].mean == pytest.approx(61.08)
    assert angle_values(None).values["knee_flexion_rom_deg"].difference_sd == pytest.approx(3.77)


def test_temporal_references_by_age_and_sex() -> None:
    woman = temporal_values(72, "female").values
    assert woman["cadence_spm"].mean == pytest.approx(113.0)
    assert woman["cadence_spm"].sd == pytest.approx(20.0)
    assert woman["cadence_spm"].source == "Hollman2011"
    assert woman["double_support_pct"].mean == pytest.approx(27.1)
    assert woman["gait_speed_mps"].comparable
    assert {n for n, v in woman.items() if not v.comparable} == {"step_width_m"}, "our width is not a ruler's"
    man = temporal_values(25.5, "male").values
    assert man["stride_time_s"].mean == pytest.approx(1.135)
    assert not man["gait_speed_mps"].comparable, "the band of a pace class is not a spread"
    of_strides = {name for name, e in CATALOGUE.items() if e.of == "stride" and e.unit in {"s", "%"}}
    assert set(woman) & of_strides == {
        "stride_time_s", "step_time_s", "stance_pct", "swing_pct", "double_support_pct", "single_support_pct",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("age", "sex", "reason"),
    [(None, "female", "age_unknown"), (40, None, "sex_unknown"), (95, "male", "no_norm_for_age")],
)
def test_no_temporal_reference_says_why(age: float | None, sex: str | None, reason: str) -> None:
    result = temporal_values(age, sex)  # type: ignore[arg-type]
    assert (dict(result.values), result.reason) == ({}, reason)


@pytest.mark.parametrize("sex", ["F", "M"])
@pytest.mark.parametrize("pace", ["slow", "normal", "fast"])
def test_age_bands_do_not_overlap(sex: str, pace: str) -> None:
    bands: dict[str, list[tuple[float, float]]] = {}
    for r in read_rows("spatiotemporal_age_sex"):
        if (r["sex"], r["pace"]) == (sex, pace):
            bands.setdefault(r["parameter"], []).append((float(r["age_min"]), float(r["age_max"])))
    for ranges in bands.values():
        ordered = sorted(ranges)
        assert all(a[1] < b[0] for a, b in pairwise(ordered))


def test_expected_step_length_and_cadence_at_a_speed() -> None:
    young = predict_at_speed(1.0, 30)
    assert young["step_length_m"].mean == pytest.approx(0.575)
    assert young["cadence_spm"].mean == pytest.approx(104.39, abs=0.01)
    older = predict_at_speed(1.0, 70)["cadence_spm"]
    assert older.group.startswith("older")
    assert older.n == 21
    assert predict_at_speed(0.3, 30) == {}


@pytest.mark.recorded
def test_a_single_side_spreads_more_than_the_mean_of_both() -> None:
    """The table's sd is of the mean of both sides; ours of one side, recomputed from the strides."""
    values = angle_values(None).values
    for name, figure in list_curve_figures().items():
        part = slice(figure.start_pct, figure.end_pct + 1)
        read = FIGURE[figure.statistic]
        joint_values = np.array([[read(p[s][figure.variable][part]) for s in SIDES] for p in people()])
        single = np.sqrt(joint_values.var(axis=0, ddof=1).mean())
        assert values[name].mean == pytest.approx(joint_values.mean(), abs=0.006)
        assert values[name].sd == pytest.approx(single, abs=0.011), name
        assert values[name].difference_sd == pytest.approx(
            np.std(joint_values[:, 0] - joint_values[:, 1], ddof=1), abs=0.006
        )


FIGURE: dict[str, Callable[[Floats], float]] = {
    "at": lambda c: float(c[0]),
    "max": lambda c: float(c.max()),
    "min": lambda c: float(c.min()),
    "range": lambda c: float(np.ptp(c)),
}


@pytest.mark.parametrize(
    ("contacts_s", "compared"), [(0.02, True), (0.06, False), (None, False), (COARSE_S, True)]
)
def test_shares_of_the_stride_compare_only_where_contacts_are_exact(
    contacts_s: float | None, compared: bool
) -> None:
    values = look_up_norms(72, "female").values
    held = look_up_norms(72, "female", contacts_s=contacts_s).values
    for name in ("stance_pct", "swing_pct", "double_support_pct", "single_support_pct"):
        assert held[name].comparable == compared
        assert compared or held[name].note.startswith("Not comparable")
    names = {name for name in values if not name.endswith("_pct")}
    assert all(held[name] == values[name] for name in names), "nothing else is touched"
