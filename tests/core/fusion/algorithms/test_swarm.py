"""Particle swarm: optimum, and identical results after an interruption."""

from __future__ import annotations

import json

import numpy as np
import pytest

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.swarm import Swarm, SwarmRules, advance_swarm, read_swarm, write_swarm

SHORT = SwarmRules(particles=8, iterations=5, rounds=3, random_rounds=2)
START = np.full(3, 0.9)


def sphere(points: Floats) -> Floats:
    return np.asarray(((points - 0.37) ** 2).sum(axis=1))


def with_holes(points: Floats) -> Floats:
    """Without a value over half of the box."""
    return np.where(points[:, 0] > 0.5, np.inf, sphere(points))


def search(rules: SwarmRules, dimensions: int = 3, seed: int = 1) -> Swarm:
    swarm = Swarm.start(dimensions)
    while swarm.step < rules.steps:
        swarm = advance_swarm(swarm, sphere, np.full(dimensions, 0.9), rules, seed)
    return swarm


def test_a_swarm_that_no_machine_holds_is_refused() -> None:
    for name in ("particles", "iterations", "rounds", "random_rounds"):
        with pytest.raises(ParameterError) as caught:
            SwarmRules(**{name: 10**9})
        assert caught.value.code == "swarm_too_large"


def test_the_constants_are_those_of_the_thesis() -> None:
    """Section 4.2.3: 50 particles, 50 iterations, 16 rounds, 4 of them random, 0.73, 0.99, 1.5, 1.5."""
    rules = SwarmRules()
    assert (rules.particles, rules.iterations, rules.rounds, rules.random_rounds) == (50, 50, 16, 4)
    assert (rules.inertia, rules.damping, rules.personal, rules.social) == (0.73, 0.99, 1.5, 1.5)


def test_the_middle_of_a_sphere_is_found_in_five_dimensions() -> None:
    assert search(SwarmRules(rounds=5), 5).best[1] < 1e-6


def test_every_round_begins_with_the_best_of_the_earlier_ones_and_never_forgets_it() -> None:
    swarm, best = Swarm.start(3), np.inf
    while swarm.step < SHORT.steps:
        swarm = advance_swarm(swarm, sphere, START, SHORT, 1)
        assert swarm.best[1] <= best
        best = swarm.best[1]
        assert (swarm.at >= swarm.low).all()
        assert (swarm.at <= swarm.high).all()
    assert len(swarm.ended) == SHORT.rounds - 1
    assert best <= sphere(START[None])[0]


def test_the_same_seed_gives_the_same_swarm_and_another_one_another() -> None:
    assert search(SHORT).best[1] == search(SHORT).best[1]
    assert search(SHORT).best[1] != search(SHORT, seed=2).best[1]


@pytest.mark.parametrize("cost", [sphere, with_holes])
def test_a_swarm_read_back_after_any_iteration_goes_on_bit_for_bit(cost: object) -> None:
    straight = resumed = Swarm.start(3)
    while straight.step < SHORT.steps:
        straight = advance_swarm(straight, cost, START, SHORT, 1)  # type: ignore[arg-type]
        resumed = read_swarm(write_swarm(resumed, "a"), "a")
        resumed = advance_swarm(resumed, cost, START, SHORT, 1)  # type: ignore[arg-type]
        assert json.dumps(resumed.to_json()) == json.dumps(straight.to_json())


def test_a_checkpoint_of_something_else_is_refused() -> None:
    content = write_swarm(Swarm.start(2), "a")
    with pytest.raises(ParameterError) as other_error:
        read_swarm(content, "b")
    assert other_error.value.code == "other_problem"
    for broken in (b"", b"{}", b"[]", b'{"problem": "a", "swarm": {"low": []}}'):
        with pytest.raises(ParameterError) as caught:
            read_swarm(broken, "a")
        assert caught.value.code == "not_a_checkpoint"


def test_an_empty_swarm_is_refused() -> None:
    with pytest.raises(ParameterError):
        SwarmRules(particles=0)
