"""The catalogue and docs/parameters.md know every parameter there is, and none that there is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from core.activity.parameters import MEASURES as DAILY
from core.functional_tests import chair, sway, tug, walks
from core.measure import measure_gait
from core.parameters.catalogue import CATALOGUE, LIMIT_FIGURES, index_entries, require_entries
from core.simulate import simulate_scenario
from core.squat.measures import MEASURES
from server.report.wording import REASONS
from tests.helpers.parameter_page import PAGE, render_page
from tests.helpers.true_walks import true_tracks

TESTS = {*tug.NAMES, *chair.NAMES, *walks.TEN, *walks.SIX, *sway.NAMES}
"""Parameters of functional tests; each measures all of its own (tests/core/functional_tests)."""


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
