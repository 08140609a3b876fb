"""Levels of one take: where they begin, when they become harder or easier, and where they end."""

from __future__ import annotations

import pytest

from sagittal.core.feedback.baseline import Baseline
from sagittal.core.feedback.cue import Zone
from sagittal.core.feedback.levels import Ladder
from sagittal.core.feedback.prescription import LEVELS, Progression
from sagittal.core.feedback.zones import Zones

ZONES = Zones(mean=0.60, sd=0.05)
LOW = Zones(mean=0.60, sd=0.05, worse="low")
RULE = Progression(window=4, share=0.7, away_share=0.5)


def ladder(
    baseline: Baseline | None = None, zones: Zones = LOW, rule: Progression = RULE, level: int | None = None
) -> Ladder:
    result = Ladder(zones, rule, baseline or Baseline())
    if level is not None:
        result.move(level)
    return result


def walk(result: Ladder, *zones: Zone) -> int:
    for zone in zones:
        result.add_stride(zone)
    result.follow_rule()
    return result.level


@pytest.mark.parametrize(
    ("baseline", "start", "level"),
    [
        (Baseline(last_level=2, mean=0.40), 5, 2),
        (Baseline(last_level=0, mean=0.40), 5, 0),
        (Baseline(mean=0.40), 5, 5),
        (Baseline(mean=0.40), None, 3),
        (Baseline(), None, 0),
    ],
)
def test_it_begins_where_the_last_training_ended_else_by_the_record_else_by_the_person(
    baseline: Baseline, start: int | None, level: int
) -> None:
    result = Ladder(LOW, Progression(start_level=start), baseline)
    assert result.level == level
    assert result.known == (baseline != Baseline() or start is not None)


def test_the_side_of_the_person_comes_from_before_or_from_the_first_strides() -> None:
    assert Ladder(ZONES, RULE, Baseline(mean=0.40)).zones.worse == "low"
    assert Ladder(ZONES, RULE, Baseline(mean=0.70)).zones.worse == "high"
    assert Ladder(LOW, RULE, Baseline(mean=0.70)).zones.worse == "low", "what the record says stays"
    unknown = Ladder(ZONES, RULE, Baseline())
    assert not unknown.known
    unknown.end_first_strides([0.74, 0.76])
    assert (unknown.zones.worse, unknown.level, unknown.known) == ("high", 2, True)


def test_first_strides_do_not_move_a_level_that_is_known() -> None:
    result = Ladder(ZONES, Progression(start_level=1), Baseline())
    assert not result.known, "the side is not"
    result.end_first_strides([0.30])
    assert (result.level, result.zones.worse, result.known) == (1, "low", True)


def test_a_full_window_in_the_zone_makes_it_harder_and_a_new_one_begins() -> None:
    result = ladder(level=3)
    assert walk(result, "in", "in", "in") == 3, "the window is not full"
    assert result.window_n == 3
    assert walk(result, "low") == 2
    assert (result.window_n, result.share("in")) == (0, None)


def test_the_share_itself_is_not_enough() -> None:
    exact = Progression(window=4, share=0.75, away_share=0.5)
    assert walk(ladder(rule=exact, level=3), "in", "in", "in", "low") == 3
    assert walk(ladder(rule=exact, level=3), "in", "in", "in", "in") == 2
    assert walk(ladder(level=3), "low", "low", "in", "in") == 3
    assert walk(ladder(level=3), "low", "low", "low", "in") == 4


def test_only_strides_on_the_worse_side_make_it_easier() -> None:
    assert walk(ladder(level=3), "high", "high", "high", "high") == 3
    assert walk(ladder(level=3), "near_low", "near_low", "near_low", "near_low") == 3
    assert walk(ladder(zones=ZONES, level=3), "low", "low", "low", "low") == 3, "no side is known"


def test_only_the_last_window_counts() -> None:
    result = ladder(level=3)
    assert walk(result, "low", "low", "in", "in") == 3
    assert walk(result, "in", "in") == 2


def test_levels_end_at_the_hardest_and_the_easiest() -> None:
    result = ladder()
    assert walk(result, "in", "in", "in", "in") == 0
    assert result.window_n == 4, "the level did not change, so the strides stay"
    result.move(LEVELS + 5)
    assert result.level == LEVELS
    result.move(-100)
    assert result.level == 0


def test_a_rule_that_is_off_leaves_it_to_people() -> None:
    result = ladder(rule=Progression(automatic=False, window=2), level=3)
    assert walk(result, "in", "in", "in") == 3
    result.move(-1)
    assert result.level == 2


def test_zones_are_those_of_the_level() -> None:
    result = ladder(level=2)
    assert result.limits == pytest.approx((0.45, 0.65))
    assert (result.zone(0.46), result.zone(0.44), result.zone(0.39)) == ("in", "near_low", "low")
    result.add_stride("in")
    result.add_stride("low")
    assert result.share("in") == result.share("low") == 0.5
    assert result.share("high") == 0.0
