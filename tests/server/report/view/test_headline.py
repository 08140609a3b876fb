"""Headline sentences, and cases without a statement."""

from __future__ import annotations

import re
from dataclasses import replace
from string import Formatter

import pytest

from sagittal.core.change import Change, sort_changes
from sagittal.core.change.verdict import Verdict
from sagittal.core.frames import Side
from sagittal.core.norms.lookup import Norms
from sagittal.core.norms.values import NormValue
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.parameters.result import Parameter
from sagittal.server.report.view.headline import LARGEST, MOST, Headline, find_changes
from sagittal.server.report.view.level import choose_zero
from sagittal.server.report.view.standouts import find_standouts
from sagittal.server.report.view.table import ParameterRow, parameter_rows
from sagittal.server.report.words.headline_phrases import PATTERNS, PHRASES

WORDS = {"noun", "word", "side", "d", "v", "o", "l", "r", "c", "b", "norm", "before", "after"}
LONGEST = 100
"""Characters of a pattern; two lines on a tablet."""


def measured(name: str, side: Side | None, mean: float, sd: float = 0.5, n: int = 30) -> Parameter:
    return Parameter(name, side, n, mean, sd, "", u_own=0.0, u_common=0.0, uncertainty=0.1)


def both_sides(name: str, left: float, right: float, sd: float = 0.5) -> tuple[Parameter, ...]:
    return measured(name, "left", left, sd), measured(name, "right", right, sd)


def norm(name: str, mean: float, sd: float, apart: float | None = None) -> Norms:
    return Norms(None, None, values={name: NormValue(name, mean, sd, 20, "adults", "a table", apart)})


def said(norms: Norms, *parameters: Parameter) -> list[str]:
    return [s.text for s in find_standouts(parameter_rows(parameters, norms), norms)[0]]


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_pattern_has_one_bold_part_and_known_words(pattern: str) -> None:
    assert pattern.count("*") == 2
    assert {field for _, field, _, _ in Formatter().parse(pattern) if field} <= WORDS


@pytest.mark.parametrize("name", [n for n, p in PHRASES.items() if p.less])
def test_a_finding_about_sides_fits_two_lines_on_a_tablet(name: str) -> None:
    p = PHRASES[name]
    sd = max(p.least, p.apart * 10.0, 0.02)
    pair = both_sides(name, 10.0 * sd, 15.0 * sd, sd=0.01 * sd)
    (text,) = said(norm(name, 10.0 * sd, sd, apart=sd), *(replace(m, uncertainty=0.01 * sd) for m in pair))
    assert len(text) <= LONGEST


def test_only_figures_of_the_catalogue_speak() -> None:
    assert set(PHRASES) <= set(CATALOGUE)


def test_a_side_that_differs_is_named_with_the_difference() -> None:
    norms = norm("knee_flexion_max_swing_deg", 60.0, 5.0, apart=3.0)
    message = said(norms, *both_sides("knee_flexion_max_swing_deg", 42.0, 60.0))
    assert message == ["Knee flexion in swing is 18° less on the left (42° vs 60°, norm 60 ± 5°)"]


@pytest.mark.parametrize(
    ("name", "left", "right"),
    [("stance_pct", 59.94, 73.46), ("step_time_s", 0.4951, 0.7449), ("circumduction_m", 0.0994, 0.0445)],
)
def test_the_difference_is_that_of_the_values_as_they_are_printed(
    name: str, left: float, right: float
) -> None:
    """The headline's difference is consistent with the printed values (59.9, 73.5, "shorter by 13.6")."""
    norms = Norms(None, None)
    parameters = both_sides(name, left, right, sd=0.001)
    (row,) = parameter_rows(parameters, norms)
    by_key = re.search(r"by ([\d.]+)", row.difference or "")
    (message,) = said(norms, *parameters)
    spoken = re.search(r"is ([\d.]+)\u202f(%|s|cm)", message)
    assert by_key is not None
    assert spoken is not None
    view = float(by_key[1]) * (100.0 if spoken[2] == "cm" else 1.0)
    assert float(spoken[1]) == pytest.approx(view, abs=0.5 if spoken[2] == "cm" else 1e-9)


def test_sides_within_what_healthy_sides_differ_by_are_not_told() -> None:
    norms = norm("knee_flexion_max_swing_deg", 60.0, 5.0, apart=3.4)
    assert said(norms, *both_sides("knee_flexion_max_swing_deg", 57.0, 63.0)) == []


def test_sides_whose_strides_overlap_are_not_told() -> None:
    nobody = Norms(None, None)
    assert said(nobody, *both_sides("foot_pitch_ic_deg", 8.0, 14.0, sd=0.5)) != []
    assert said(nobody, *both_sides("foot_pitch_ic_deg", 8.0, 14.0, sd=30.0)) == []


def test_both_sides_beyond_the_norm_are_one_sentence() -> None:
    norms = norm("knee_flexion_rom_deg", 62.0, 5.0, apart=3.8)
    message = said(norms, *both_sides("knee_flexion_rom_deg", 40.0, 41.0))
    assert message == ["Knee range of motion is reduced on both sides (left 40°, right 41°, norm 62 ± 5°)"]


def test_of_two_sides_that_differ_the_one_off_the_norm_is_spoken_of() -> None:
    norms = norm("hip_flexion_rom_deg", 37.0, 4.5, apart=2.6)
    message = said(norms, *both_sides("hip_flexion_rom_deg", 52.0, 36.0))
    assert message == ["Hip range of motion is 16° more on the left (52° vs 36°, norm 37 ± 4°)"]


@pytest.mark.parametrize("name", [n for n, p in PHRASES.items() if p.less])
@pytest.mark.parametrize("off", ["left", "right"])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_leg_further_from_its_norm_is_named(name: str, off: Side, sign: float) -> None:
    """The other leg is 0.5 SD off the mean, on the same side of it."""
    p = PHRASES[name]
    sd = max(p.least, p.apart * 10.0, 0.02)
    mean = 10.0 * sd
    values = {"left": mean + sign * 0.5 * sd, "right": mean + sign * 0.5 * sd, off: mean + sign * 4.0 * sd}
    norms = norm(name, mean, sd, apart=sd)
    measured_ = both_sides(name, values["left"], values["right"], sd=0.01 * sd)
    exact = tuple(replace(m, uncertainty=0.01 * sd) for m in measured_)
    (sentence,) = find_standouts(parameter_rows(exact, norms), norms)[0]
    assert (sentence.side, sentence.kind) == (off, "sides")
    assert f" on the {off} (" in sentence.text


@pytest.mark.parametrize("name", [n for n, p in PHRASES.items() if p.less])
def test_legs_within_their_norm_make_no_sentence_about_sides(name: str) -> None:
    p = PHRASES[name]
    sd = 2.0 * max(p.least, p.apart * 10.0, 0.02)
    mean = 10.0 * sd
    pair = both_sides(name, mean - 1.5 * sd, mean + 1.5 * sd, sd=0.01 * sd)
    exact = tuple(replace(m, uncertainty=0.01 * sd) for m in pair)
    norms = norm(name, mean, sd, apart=0.1 * sd)
    assert said(norms, *exact) == []
    (sentence,) = find_standouts(parameter_rows(exact), Norms(None, None))[0]
    assert sentence.side == ("right" if p.names_larger else "left"), "without a norm the sides are compared"


def test_within_two_deviations_nothing_stands_out() -> None:
    norms = norm("gait_speed_mps", 1.25, 0.16)
    standouts, looked_at = find_standouts(
        parameter_rows((measured("gait_speed_mps", None, 0.94),), norms), norms
    )
    assert (standouts, looked_at) == ((), 1)
    message = said(norms, measured("gait_speed_mps", None, 0.80))
    assert message == ["Gait speed is below normal for age (0.80\u202fm/s, norm 1.25 ± 0.16\u202fm/s)"]


def test_a_value_that_is_hardly_known_is_not_called_unusual() -> None:
    norms = norm("stance_pct", 63.0, 1.8)
    sure = both_sides("stance_pct", 59.0, 59.0)
    assert said(norms, *sure) == [
        "Stance phase is shortened on both sides (left 59.0 %, right 59.0 %, norm 63.0 ± 1.8 %)".replace(
            " %", "\u202f%"
        )
    ]
    assert said(norms, *(replace(p, uncertainty=4.3) for p in sure)) == []


def test_the_caption_says_whom_the_sentences_compare_with() -> None:
    slow = norm("gait_speed_mps", 1.25, 0.16)
    single_standouts = find_standouts(parameter_rows((measured("gait_speed_mps", None, 0.80),), slow), slow)[
        0
    ]
    assert Headline("", single_standouts).compared_with == "vs people of this age"
    uneven = find_standouts(parameter_rows(both_sides("foot_pitch_ic_deg", 5.0, 20.0)), Norms(None, None))[0]
    assert Headline("", uneven).compared_with == "vs the other side"
    assert (
        Headline("", (*single_standouts, *uneven)).compared_with == "vs people of this age and the other side"
    )
    assert Headline("").compared_with == ""


def standing_pair(left: float, right: float) -> tuple[ParameterRow, ...]:
    """Rows of one figure from standing, where the sides differ, and from the anatomical zero, where not."""
    name = "hip_flexion_min_deg"
    from_standing = parameter_rows(both_sides(name, -23.0, -15.0), Norms(None, None))
    anatomical = parameter_rows(both_sides(name, left, right, sd=20.0), Norms(None, None), zero="anatomical")
    return (*from_standing, *(replace(r, name="hip_flexion_min_anatomical_deg") for r in anatomical))


def test_a_sentence_is_about_the_row_whose_zero_is_that_of_the_curve() -> None:
    """From standing the right hip stays 8° short, from the anatomical zero there is no clear difference."""
    rows = standing_pair(-10.8, -3.2)
    assert rows[1].difference == "no clear difference"
    for anatomical, names in (({"hip_flexion"}, []), (set(), ["hip_flexion_min_deg"])):
        page = choose_zero(rows, anatomical)
        assert len(page) == 1
        standouts, _ = find_standouts(page, Norms(None, None))
        assert [s.name for s in standouts] == names
        assert all(row.difference != "no clear difference" for row in page if row.name in names)


def test_a_rank_is_that_of_a_row_and_of_its_curve() -> None:
    rows = parameter_rows(
        [
            *both_sides("knee_flexion_max_swing_deg", 20.0, 60.0),
            *both_sides("circumduction_m", 0.2, 0.0, 0.01),
        ],
        Norms(None, None),
    )
    headline = Headline("", find_standouts(rows, Norms(None, None))[0])
    assert set(headline.ranks) == {row.name for row in rows}
    assert headline.curve_ranks == {"knee_flexion": (headline.ranks["knee_flexion_max_swing_deg"],)}


def test_few_strides_are_compared_with_nobody() -> None:
    few = measured("knee_flexion_rom_deg", "left", 20.0, n=3), measured("knee_flexion_rom_deg", "right", 60.0)
    assert said(Norms(None, None), *few) == []


def test_short_and_quick_steps_are_one_sentence() -> None:
    norms = Norms(
        None,
        None,
        values={
            "step_length_m": NormValue("step_length_m", 0.51, 0.05, 20, "adults", "a table"),
            "cadence_spm": NormValue("cadence_spm", 75.0, 7.3, 20, "adults", "a table"),
        },
    )
    steps = both_sides("step_length_m", 0.28, 0.27, sd=0.01)
    message = said(norms, *steps, measured("cadence_spm", None, 140.0))
    assert message == [
        "Steps are short and quick (0.28\u202fm at 140\u202fsteps/min, norm 0.51 ± 0.05\u202fm)"
    ]


def change(name: str, side: Side | None, key: float, limit: float, verdict: Verdict | None) -> Change:
    return Change(
        name, side, "", 1.0, 1.0 + key, key, verdict, limit, "a table", None, None, None, None, None, None
    )


def test_changes_beyond_their_limit_are_told_and_the_others_counted() -> None:
    facts = sort_changes([
        change("gait_speed_mps", None, 0.22, 0.1, "real_change"),
        change("step_length_m", "left", 0.11, 0.05, "real_change"),
        change("step_length_m", "right", 0.12, 0.05, "clinically_relevant"),
        change("stance_pct", "left", 0.4, 2.0, "within_measurement_error"),
        replace(change("circumduction_m", "left", 0.1, 1.0, None), limit=None),
    ])  # fmt: skip
    assert [s.text for s in find_changes(facts)] == [
        "Step length has increased on both sides (left by 0.11 m, right by 0.12 m)",
        "Gait speed has increased by 0.22\u202fm/s (1.00\u202fm/s to 1.22\u202fm/s)",
    ]
    assert (len(facts.real), facts.within, facts.unjudged) == (3, 1, 1)


def test_a_clinically_relevant_change_is_told_before_a_larger_one() -> None:
    facts = sort_changes([
        change("gait_speed_mps", None, 0.5, 0.1, "real_change"),
        change("knee_flexion_max_swing_deg", "left", 11.7, 3.0, "real_change"),
        change("knee_flexion_rom_deg", "left", 11.7, 5.2, "clinically_relevant"),
    ])  # fmt: skip
    changes = find_changes(facts)
    assert [s.name for s in changes] == ["knee_flexion_rom_deg", "gait_speed_mps"]
    headline = Headline("", changed=changes, changes=facts)
    assert [(c.title, c.side, c.size) for c in headline.changes_left] == [
        ("Peak knee flexion in swing, relative to standing", "left", "+11.7")
    ]


def test_every_real_change_is_a_sentence_or_named_with_its_size() -> None:
    facts = sort_changes([
        change("step_length_m", "left", 0.11, 0.05, "real_change"),
        change("step_length_m", "right", 0.12, 0.05, "real_change"),
        change("stance_pct", "right", -6.2, 4.2, "real_change"),
        change("swing_pct", "right", 6.2, 4.2, "real_change"),
        change("swing_time_s", "left", 0.2, 0.1, "real_change"),
        change("max_heel_clearance_m", "left", 0.09, 0.04, "real_change"),
    ])  # fmt: skip
    headline = Headline("", changed=find_changes(facts), changes=facts)
    assert [s.name for s in headline.shown_changes] == ["step_length_m", "stance_pct"]
    left = [(c.title, c.side) for c in headline.changes_left]
    assert left == [("Swing time", "left"), (CATALOGUE["max_heel_clearance_m"].label, "left")]
    assert len(facts.real) == 5


def test_at_most_six_sentences_and_the_rest_is_named() -> None:
    norms = Norms(None, None)
    parameters = [
        p
        for name, left, right in (
            ("step_length_m", 0.3, 0.6), ("stance_pct", 50.0, 70.0), ("foot_pitch_ic_deg", -5.0, 20.0),
            ("circumduction_m", 0.2, 0.0), ("foot_pitch_tc_deg", -30.0, -60.0),
            ("hip_flexion_rom_deg", 20.0, 50.0), ("knee_flexion_max_swing_deg", 20.0, 60.0),
            ("knee_flexion_ic_deg", 30.0, 5.0),
        )
        for p in both_sides(name, left, right, sd=0.01)
    ]  # fmt: skip
    standouts, _ = find_standouts(parameter_rows(parameters, norms), norms)
    facts = sort_changes([change("gait_speed_mps", None, 0.22, 0.1, "real_change")])
    headline = Headline("", standouts, find_changes(facts), changes=facts)
    assert len(standouts) == 8
    assert max(s.size for s in standouts) == LARGEST
    assert len(headline.shown) + len(headline.shown_changes) == MOST
    assert len(headline.standouts_left) == 3
    assert headline.changes_left == ()
