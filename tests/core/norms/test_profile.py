"""Distance of curves from a reference, and the healthy people it is compared with."""

from __future__ import annotations

import numpy as np
import pytest

from sagittal.core.frames import SIDES, Floats, Side
from sagittal.core.norms import adult_reference
from sagittal.core.norms.profile import (
    MODES,
    NINE,
    PROFILES,
    SAGITTAL,
    gvs,
    leave_one_out,
    overall_profile,
    side_profile,
)
from sagittal.core.norms.tables import read_rows
from tests.helpers.wbds import people


@pytest.mark.recorded
def test_the_healthy_side_score_is_the_published_one_leave_one_out() -> None:
    """Side GPS 4.95 ± 1.46° raw, 2.35 ± 0.51° shape alone; overall 5.23 ± 1.33°.

    docs/science/norms-and-scores.md, "GVS and GPS".
    """
    spreads = leave_one_out(people())
    side = spreads["raw"]["gps_side"]
    assert (side.mean_deg, side.sd_deg) == pytest.approx((4.95, 1.46), abs=0.005)
    assert side.p95_deg == pytest.approx(7.32, abs=0.005)
    overall = spreads["raw"]["gps_overall"]
    assert (overall.mean_deg, overall.sd_deg) == pytest.approx((5.23, 1.33), abs=0.005)
    shape = spreads["offset_removed"]["gps_side"]
    assert (shape.mean_deg, shape.sd_deg) == pytest.approx((2.35, 0.51), abs=0.005)


@pytest.mark.recorded
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


def test_people_who_lack_a_side_or_a_joint_are_scored_by_what_they_have() -> None:
    """Against one person after the other: the mean of the others, and the profiles of that person alone."""
    rng = np.random.default_rng(0)
    group: list[dict[Side, dict[str, Floats]]] = [
        {
            side: {v: rng.normal(0.0, 10.0, 101) for v in NINE if rng.random() < share}
            for side in SIDES
            if rng.random() < share
        }
        for share in (1.0, 1.0, 0.9, 0.7, 1.0, 0.9, 0.0, 1.0)
    ]
    for mode in MODES:
        expected: dict[str, list[float]] = {}
        for this in group:
            scores: dict[Side, dict[str, float]] = {side: {} for side in SIDES}
            for side, own in this.items():
                for variable, curve in own.items():
                    other_averages = [
                        np.mean(
                            [source[variable] for source in person.values() if variable in source], axis=0
                        )
                        for person in group
                        if person is not this and any(variable in source for source in person.values())
                    ]
                    scores[side][variable] = float(gvs(curve, np.mean(other_averages, axis=0), mode))
                    expected.setdefault(variable, []).append(scores[side][variable])
            for name, variables in PROFILES.items():
                values = {
                    f"{name}_side": [side_profile(scores[side], variables) for side in SIDES],
                    f"{name}_overall": [overall_profile(scores, variables)],
                }
                for part, result in values.items():
                    expected.setdefault(part, []).extend(x for x in result if x is not None)
        assert 1 < len(expected["gps_side"]) < 2 * len(expected["gps_overall"]) + 4 < 2 * len(group)
        spreads = leave_one_out(group)[mode]
        assert set(spreads) == set(expected)
        for label, x in expected.items():
            assert spreads[label].mean_deg == pytest.approx(np.mean(x), rel=1e-12), label
            assert spreads[label].sd_deg == pytest.approx(np.std(x, ddof=1), rel=1e-12), label


def test_one_person_alone_has_nobody_to_be_compared_with() -> None:
    assert leave_one_out([{"left": {"knee_flexion": np.zeros(101)}}]) == {"raw": {}, "offset_removed": {}}
