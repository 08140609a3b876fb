"""docs/parameters.md and the table know every parameter there is, and none that there is not."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from core.measure import measure
from core.simulate import simulate_scenario
from server.report.wording import REASONS, TERMS
from tests.data import ROOT
from tests.true_walks import true_tracks


@pytest.fixture(scope="module")
def names() -> set[str]:
    tracks = true_tracks(simulate_scenario("comfortable", 5).truth)
    whole = replace(tracks, trunk={"pelvis": np.zeros((len(tracks.t_s), 3))})
    # steps are those of a trunk sensor alone
    return {p.name for p in measure(whole).parameters} | {"step_count"}


def test_every_parameter_is_written_down(names: set[str]) -> None:
    text = (ROOT / "docs" / "parameters.md").read_text(encoding="utf-8")
    cells = re.findall(r"^\| (`[^|]+`) \|", text, re.MULTILINE)
    written = {name for cell in cells for name in re.findall(r"`(\w+)`", cell)}
    assert written == names


def test_every_parameter_has_words(names: set[str]) -> None:
    assert names <= set(TERMS)


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
    said = {p.reason for take in takes for p in measure(take).parameters if p.reason is not None}
    assert len(said) > 5
    assert said <= set(REASONS)
