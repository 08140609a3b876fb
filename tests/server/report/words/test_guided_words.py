"""Instructions of a guided test in every phase of every test."""

from __future__ import annotations

from typing import get_args

import pytest

from sagittal.core.functional_tests.guided import GUIDED, STANDING_TESTS
from sagittal.core.functional_tests.result import TestPhase
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.server.report.words.guided_words import HINTS, OVER, SAYS, TOTAL, tell_person


def test_every_guided_test_has_words_a_hint_and_a_figure_of_the_catalogue() -> None:
    assert set(SAYS) == set(HINTS) == set(TOTAL) == set(GUIDED)
    assert set(TOTAL.values()) <= set(CATALOGUE)


@pytest.mark.parametrize("protocol", GUIDED)
def test_every_phase_has_words_and_after_the_test_the_person_may_rest(protocol: str) -> None:
    phases = get_args(TestPhase)
    by_phase = {phase: tell_person(protocol, phase) for phase in phases}
    assert set(SAYS[protocol]) < set(phases)
    assert {phase for phase in phases if by_phase[phase] == OVER} == set(phases) - set(SAYS[protocol])
    assert len(set(by_phase.values())) == len(SAYS[protocol]) + 1


@pytest.mark.parametrize("protocol", sorted(set(GUIDED) - set(STANDING_TESTS)))
def test_who_has_to_move_at_go_is_told_so_before(protocol: str) -> None:
    assert tell_person(protocol, "ready").startswith("On “Go”: ")


def test_who_closes_the_eyes_has_somebody_beside_them() -> None:
    assert "Someone is next to you." in tell_person("standing_eyes_closed", "get_ready")
    assert tell_person("standing_eyes_closed", "running").endswith("Eyes closed.")
    assert tell_person("standing_eyes_open", "running").endswith("Eyes open.")
