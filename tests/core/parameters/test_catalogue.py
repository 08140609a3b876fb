"""The catalogue and docs/reference/parameters.md know every parameter there is, and no other."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.activity.parameters import MEASURES as DAILY
from sagittal.core.events.result import Stride
from sagittal.core.functional_tests import chair, sway, tug, walks
from sagittal.core.norms.values import angle_values, temporal_values
from sagittal.core.parameters.catalogue import (
    CATALOGUE,
    LIMIT_FIGURES,
    ParameterEntry,
    entry,
    index_entries,
    require_entries,
)
from sagittal.core.parameters.catalogue.angles import ENTRIES as ANGLES
from sagittal.core.parameters.catalogue.daily import ENTRIES as OF_DAYS
from sagittal.core.parameters.catalogue.distances import ENTRIES as DISTANCES
from sagittal.core.parameters.catalogue.errors import ANKLE_RANGE, HIP_RANGE, KNEE_RANGE, LEVELS
from sagittal.core.parameters.catalogue.functional import ENTRIES as OF_TESTS
from sagittal.core.parameters.catalogue.limit_figures import ENTRIES as LIMITED
from sagittal.core.parameters.catalogue.phases import ENTRIES as PHASES
from sagittal.core.parameters.catalogue.squat import ENTRIES as SQUATS
from sagittal.core.parameters.catalogue.support import ENTRIES as SUPPORT
from sagittal.core.parameters.catalogue.times import ENTRIES as TIMES
from sagittal.core.parameters.catalogue.trunk import ENTRIES as OF_TRUNK
from sagittal.core.parameters.catalogue.walking import ENTRIES as WALKS
from sagittal.core.parameters.measure import measure_gait
from sagittal.core.parameters.temporal import stride_values
from sagittal.core.simulate import simulate_scenario
from sagittal.core.squat.measures import MEASURES
from sagittal.server.report.words.wording import REASONS
from tests.helpers.parameter_page import PAGE, render_page
from tests.helpers.true_walks import true_tracks

TESTS = {*tug.NAMES, *chair.NAMES, *walks.TEN, *walks.SIX, *sway.NAMES}
"""Parameters of functional tests; each measures all of its own (tests/core/functional_tests)."""

EVERY = (*CATALOGUE.values(), *LIMIT_FIGURES.values())


@pytest.fixture(scope="module")
def names() -> set[str]:
    tracks = true_tracks(simulate_scenario("comfortable", 5).truth)
    whole = replace(tracks, trunk={"pelvis": np.zeros((len(tracks.t_s), 3))})
    # steps are those of a trunk sensor alone
    others = {"step_count"} | set(MEASURES) | set(DAILY) | TESTS
    return {p.name for p in measure_gait(whole).parameters} | others


@pytest.mark.slow
def test_the_catalogue_knows_what_is_measured_and_nothing_else(names: set[str]) -> None:
    assert set(CATALOGUE) == names


def test_a_registry_with_a_name_that_the_catalogue_does_not_have_cannot_be_built() -> None:
    require_entries([*CATALOGUE, *LIMIT_FIGURES], "all of them")
    with pytest.raises(ValueError, match=r"core\.rules uses figures .* stride_colour_nm"):
        require_entries(("stride_time_s", "stride_colour_nm"), "core.rules")


def test_a_name_stands_in_the_catalogue_once() -> None:
    entry = CATALOGUE["stride_time_s"]
    with pytest.raises(ValueError, match="two entries of the name stride_time_s"):
        index_entries((entry, entry))
    assert not set(CATALOGUE) & set(LIMIT_FIGURES)


def test_the_document_has_the_tables_of_the_catalogue() -> None:
    text = PAGE.read_text("utf-8")
    assert render_page(text) == text, "write them: python -m tests.helpers.parameter_page"


def test_a_table_without_a_group_is_found() -> None:
    with pytest.raises(ValueError, match="Beauty"):
        render_page(PAGE.read_text("utf-8") + "\n<!-- catalogue: Beauty -->\n<!-- end -->\n")


@pytest.mark.slow
def test_every_reason_has_words() -> None:
    """Without any sensor, any event or any shoe: whatever is said is said in words."""
    tracks = true_tracks(simulate_scenario("comfortable", 5).truth)
    assert tracks.feet is not None
    bare = replace(tracks.feet, body=replace(tracks.feet.body, sole_back=None, standing_width=None))
    takes = (
        replace(tracks, events=replace(tracks.events, events=())),
        replace(tracks, feet=None),
        replace(tracks, q={}, valid={}),
        replace(tracks, feet=replace(bare, linked=False)),
        replace(tracks, angles=replace(tracks.angles, angles={}) if tracks.angles else None),
    )
    said = {p.reason for take in takes for p in measure_gait(take).parameters if p.reason is not None}
    assert len(said) > 5
    assert said <= set(REASONS)


@pytest.mark.parametrize(
    ("entries", "groups"),
    [
        (DISTANCES, {entry.DISTANCES}),
        (TIMES, {entry.TIMING}),
        (PHASES, {entry.PHASES, entry.PARTS}),
        (ANGLES, {entry.HIP_AND_KNEE, entry.ANKLE_AND_FOOT}),
        (WALKS, {entry.WALKING}),
        (OF_TRUNK, {entry.TRUNK}),
        (SUPPORT, {entry.SUPPORT}),
        (SQUATS, {entry.SQUAT}),
        (OF_TESTS, set(entry.FUNCTIONAL)),
        (OF_DAYS, {entry.DAILY}),
        (LIMITED, {entry.LIMITS}),
    ],
)
def test_each_part_holds_its_groups_whole(entries: tuple[ParameterEntry, ...], groups: set[str]) -> None:
    assert {e.group for e in entries} == groups
    assert [e.name for e in entries] == [e.name for e in EVERY if e.group in groups]


def test_the_seconds_that_the_contacts_weigh_are_those_of_the_stride() -> None:
    stride = Stride("left", 1.0, 1.73, 2.21, 1.14, 1.58)
    values, found = stride_values(stride), set()
    for e in EVERY:
        weights = None if e.errors is None else e.errors.contacts
        if weights is None:
            continue
        found.add(e.name)
        seconds = (
            weights.start * 1.0
            + weights.off * 1.73
            + weights.end * 2.21
            + weights.other_off * 1.14
            + weights.other * 1.58
        )
        assert values[e.name] == pytest.approx(100.0 * seconds / 1.21 if e.unit == "%" else seconds), e.name
    assert found == set(values)


def test_a_range_is_known_less_well_than_a_level_and_a_stride_alike() -> None:
    for level, span in zip(LEVELS.values(), (HIP_RANGE, KNEE_RANGE, ANKLE_RANGE), strict=True):
        assert span.common**2 == pytest.approx(2.0 * level.common**2)
        assert span.own**2 == pytest.approx(2.0 * level.own**2)
        assert (span.source, span.random) == (level.source, level.random)


def test_levels_have_the_errors_of_their_variable() -> None:
    read = [e for e in ANGLES if e.curve is not None and e.curve.statistic != "range"]
    assert {e.curve.variable for e in read if e.curve is not None} == set(LEVELS)
    assert all(e.curve is not None and e.errors is LEVELS[e.curve.variable] for e in read)


def test_a_reference_lies_on_the_bar_and_was_read_in_the_same_part_of_the_stride() -> None:
    norms = {**angle_values(40.0).values, **temporal_values(40.0, "female").values}
    assert set(norms) == {e.name for e in EVERY if e.norm is not None}
    for e in EVERY:
        if e.norm is None:
            continue
        low, high = e.scale
        assert low <= norms[e.name].mean <= high, e.name
        window = re.search(r"\((\d+)-(\d+)%\)", e.norm.row)
        if window is not None and e.curve is not None:
            assert (e.curve.start_pct, e.curve.end_pct) == (int(window[1]), int(window[2])), e.name
        for end, statistic in (("_IC", "at"), ("ROM", "range")):
            assert (e.curve is not None and e.curve.statistic == statistic) == e.norm.row.endswith(end) or (
                e.norm.table == "walkway"
            ), e.name


def test_what_is_said_of_an_entry_agrees_with_itself() -> None:
    for e in EVERY:
        low, high = e.scale
        assert low < high, e.name
        assert e.definition.endswith("."), e.name
        assert e.plausible[0] <= low or e.plausible[0] > 0.0, e.name
        assert high <= e.plausible[1], e.name
        assert len(set(e.comparison)) == 2, e.name
        assert len(set(e.needs)) == len(e.needs), e.name
        assert e.of == "take" or (e.counted == "strides" and e.group not in entry.FUNCTIONAL), e.name
        assert not e.trainable or e.of == "stride", e.name
        if e.name.endswith("_pct") and e.of == "stride":
            assert 0 <= low < high <= 100, e.name
        if e.name.endswith("_count"):
            assert (e.digits, low) == (0, 0), e.name
    labels = [(e.group, e.label) for e in EVERY]
    assert len(set(labels)) == len(labels)
