"""A prescription of biofeedback in words."""

from __future__ import annotations

from typing import Any

import pytest

from sagittal.server.report.words.feedback_words import (
    NBSP,
    digits_of,
    format_quantity,
    name_target,
    prescription_words,
    schedule_words,
    target_words,
)
from sagittal.server.report.words.wording import parameter_term
from tests.helpers.feedback import prescription

METRES = parameter_term("step_length_m")


def words(label: str, **changes: Any) -> str:
    return dict(prescription_words(prescription(**changes)))[label]


def test_the_record_is_read_in_the_order_in_which_a_therapist_fills_it_in() -> None:
    labels = [label for label, _ in prescription_words(prescription())]
    assert labels == ["Trained", "Target", "Zone", "Display name", "Schedule", "Level", "Ends", "Watched"]


def test_a_target_is_named_by_parameter_and_side() -> None:
    assert name_target(prescription()) == "Step length, left"
    assert name_target(prescription(side=None)) == "Step length, both sides"


def test_a_value_has_a_narrow_space_before_its_unit_but_none_before_degrees() -> None:
    assert format_quantity(0.5, METRES) == f"0.50{NBSP}m"
    assert format_quantity(0.5, METRES, 1) == f"0.5{NBSP}m"
    assert format_quantity(-12.34, parameter_term("knee_flexion_rom_deg"), 1) == "−12.3°"


@pytest.mark.parametrize(("sd", "digits"), [(None, 2), (0.05, 2), (0.049, 3)])
def test_a_small_spread_gets_a_decimal_more(sd: float | None, digits: int) -> None:
    target = {"mean": 0.6, "sd": sd} if sd is not None else {"source": "norm", "mean": None, "sd": None}
    assert digits_of(prescription(target=target)) == digits


def test_a_target_says_whose_it_is() -> None:
    assert target_words(prescription()) == f"0.60 ± 0.05{NBSP}m, entered"
    norm = {"source": "norm", "mean": 0.6, "sd": 0.05, "words": "adults"}
    assert target_words(prescription(target=norm)) == f"0.60 ± 0.05{NBSP}m, adults"
    unnamed = norm | {"words": ""}
    assert target_words(prescription(target=unnamed)).endswith(", healthy people at this person's speed")


def test_a_target_that_no_take_has_resolved_yet_is_its_source() -> None:
    own = {"source": "own_baseline", "mean": None, "sd": None}
    assert target_words(prescription(target=own)) == "the person's own baseline"


def test_a_schedule_says_shares_probes_and_retention() -> None:
    every = {"kind": "every", "probe_every": None, "retention_strides": 0}
    assert schedule_words(prescription(schedule=every)) == "every stride"
    fading = {"kind": "fading", "shares_pct": [100, 50], "strides_per_share": 30, "retention_strides": 0}
    assert (
        schedule_words(prescription(schedule=fading))
        == f"100{NBSP}% → 50{NBSP}% of the strides, 30 strides each"
    )
    one = fading | {"shares_pct": [60]}
    assert schedule_words(prescription(schedule=one)) == f"60{NBSP}% of the strides"
    probed = every | {"probe_every": 40, "probe_strides": 10, "retention_strides": 20}
    assert schedule_words(prescription(schedule=probed)) == (
        "every stride; after every 40, 10 without; a visit after a training starts with 20 without"
    )


def test_what_is_shown_and_of_which_strides() -> None:
    assert words("Display name", modes=["bar", "tone"]) == "a bar, a tone outside the zone"
    assert words("Display name", positive_only=True) == "a bar; only strides in the zone"
    assert words("Display name", bandwidth=True) == "a bar; only strides outside the zone"


def test_zone_and_level_say_their_width_and_when_it_becomes_harder() -> None:
    assert words("Zone", band_sd=1.5, progression={"sd_per_level": 0.5}) == (
        "target ± 1.5 SD; each level is 0.5 SD wider"
    )
    assert words("Level", progression={"automatic": False, "start_level": 3}) == (
        "starts at level 3; changed manually"
    )
    assert words("Level") == (
        f"starts as difficult as the last walk allows; harder when more than 70{NBSP}% of 20 strides are in "
        f"the zone, easier when more than 50{NBSP}% are far off target"
    )


def test_the_end_is_what_comes_first_or_the_therapist() -> None:
    assert words("Ends") == "when the therapist stops it"
    rule = {"max_minutes": 2.5, "max_strides": 1, "gps_rise_deg": 3.2}
    assert words("Ends", stop_rule=rule) == (
        "after 2.5 min, after 1 stride, when the sagittal profile score rises by 3.2°"
    )


def test_what_is_watched_beside_the_target() -> None:
    assert words("Watched") == (
        "a change of the other side by its MDC, a rise of the sagittal profile score by 1.6°"
    )
    assert words("Watched", guard={"other_change": 0.1, "gps_rise_deg": None}) == (
        f"a change of the other side by 0.10{NBSP}m"
    )
    assert words("Watched", side=None, guard={"gps_rise_deg": None}) == "nothing"
