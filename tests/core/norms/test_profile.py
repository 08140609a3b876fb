"""Distance of curves from a reference, and the healthy people it is compared with."""

from __future__ import annotations

import numpy as np
import pytest

from core.norms import adult_reference
from core.norms.profile import MODES, NINE, SAGITTAL, gvs, leave_one_out, overall_profile, side_profile
from core.norms.tables import read_rows
from tests.wbds import people


def test_the_healthy_side_score_is_the_published_one_leave_one_out() -> None:
    """docs/norms.md, "Scores": side GPS 4.95 ± 1.46° raw, 2.35 ± 0.51° shape alone; overall 5.23 ± 1.33°."""
    spreads = leave_one_out(people())
    side = spreads["raw"]["gps_side"]
    assert (side.mean_deg, side.sd_deg) == pytest.approx((4.95, 1.46), abs=0.005)
    assert side.p95_deg == pytest.approx(7.32, abs=0.005)
    overall = spreads["raw"]["gps_overall"]
    assert (overall.mean_deg, overall.sd_deg) == pytest.approx((5.23, 1.33), abs=0.005)
    shape = spreads["offset_removed"]["gps_side"]
    assert (shape.mean_deg, shape.sd_deg) == pytest.approx((2.35, 0.51), abs=0.005)


def test_every_shipped_spread_is_recomputed_from_the_strides() -> None:
    """The sagittal table is ours, the other was prepared; one computation gives both to their last digit."""
    spreads, shipped = leave_one_out(people()), adult_reference().spreads
    for mode in MODES:
        assert set(spreads[mode]) == set(shipped[mode])
        for name, own in spreads[mode].items():
            table = shipped[mode][name]
            for figure in ("mean_deg", "sd_deg", "median_deg", "p75_deg", "p95_deg"):
                assert getattr(own, figure) == pytest.approx(getattr(table, figure), abs=0.0051), (mode, name)
            if table.mean_ln is not None:
                assert (own.mean_ln, own.sd_ln) == pytest.approx((table.mean_ln, table.sd_ln), abs=5.1e-5)


def test_the_sagittal_table_has_its_own_name_for_every_row() -> None:
    assert {r["score"] for r in read_rows("gps_sagittal_wbds")} == {
        "GPS_sagittal_side_3",
        "GPS_sagittal_overall_6",
    }


def test_scores_are_root_mean_squares_not_means() -> None:
    curve = np.zeros(101)
    assert gvs(curve + 3.0, curve, "raw") == pytest.approx(3.0)
    assert gvs(curve + 3.0, curve, "offset_removed") == pytest.approx(0.0)
    wave = np.sqrt(2.0) * np.sin(np.linspace(0.0, 2.0 * np.pi, 101, endpoint=False))
    assert gvs(2.0 * wave, curve, "raw") == pytest.approx(2.0)
    scores = dict.fromkeys(NINE, 0.0) | {"knee_flexion": 9.0}
    assert side_profile(scores, NINE) == pytest.approx(3.0), "the mean would be 1"


def test_the_pelvis_counts_once_in_the_overall_score() -> None:
    left = dict.fromkeys(NINE, 1.0)
    right = dict.fromkeys(NINE, 1.0) | {"pelvis_tilt": 50.0}
    assert overall_profile({"left": left, "right": right}, NINE) == pytest.approx(1.0)
    left["pelvis_tilt"] = 4.0
    assert overall_profile({"left": left, "right": right}, NINE) == pytest.approx(np.sqrt((16 + 14) / 15))


def test_a_profile_without_one_of_its_variables_does_not_exist() -> None:
    scores = dict.fromkeys(NINE[:-1], 1.0)
    assert side_profile(scores, NINE) is None
    assert side_profile(scores, SAGITTAL) == pytest.approx(1.0)
    assert overall_profile({"left": scores}, SAGITTAL) is None


def test_one_person_alone_has_nobody_to_be_compared_with() -> None:
    assert leave_one_out([{"left": {"knee_flexion": np.zeros(101)}}]) == {"raw": {}, "offset_removed": {}}
