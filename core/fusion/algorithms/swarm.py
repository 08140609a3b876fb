"""Particle swarm with the constants and rounds of Nazarahari 2021, section 4.2.3.

Each iteration uses a separate random generator (seed, round, iteration), so that a swarm restored from its
file continues exactly as if it had never been interrupted.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, Final, Self

import numpy as np

from sagittal.core.errors import ParameterError
from sagittal.core.frames import Floats
from sagittal.core.message import Message

Cost = Callable[[Floats], Floats]
"""Points (p, d) in the unit box → what is to be small (p,); inf where there is no value."""

MARGIN: Final = 0.1
"""Rounds after the first look this far beyond the points found so far (own choice)."""


MOST_OF_SWARM: Final = {"particles": 500, "iterations": 500, "rounds": 100, "random_rounds": 100}
"""Ten times the thesis and more; beyond it a search takes weeks (own choice)."""


@dataclass(frozen=True)
class SwarmRules:
    """Constants of a search.

    Parameters
    ----------
    particles, iterations : per round. rounds : total number. random_rounds : initial rounds, independent of
        others. inertia : of the velocity. damping : of the inertia, per iteration. personal, social :
        learning coefficients. longest_step : of a coordinate in an iteration, fraction of its range (own
        choice).
    """

    particles: int = 50
    iterations: int = 50
    rounds: int = 16
    random_rounds: int = 4
    inertia: float = 0.73
    damping: float = 0.99
    personal: float = 1.5
    social: float = 1.5
    longest_step: float = 0.2

    def __post_init__(self) -> None:
        if min(self.particles, self.iterations, self.rounds, self.random_rounds) < 1:
            raise ParameterError("swarm_empty", "A swarm has at least one particle, iteration and round.")
        for name, most in MOST_OF_SWARM.items():
            if getattr(self, name) > most:
                raise ParameterError(
                    "swarm_too_large",
                    Message(
                        "{name} is {self}; expected at most {most}.",
                        name=name,
                        self=getattr(self, name),
                        most=most,
                    ),
                )

    @property
    def steps(self) -> int:
        """Number of evaluations of the whole swarm."""
        return self.rounds * (self.iterations + 1)


@dataclass(frozen=True, eq=False)
class Swarm:
    """State of a search after some iterations.

    Parameters
    ----------
    step : iterations done, over all rounds. at, velocity, own : (p, d) positions, velocities and best
        positions of the particles of this round. cost : (p,) at their best positions. low, high : (d,) range
        of this round.
    ended, ended_cost : (r, d), (r,) best position of each earlier round.
    """

    step: int
    at: Floats
    velocity: Floats
    own: Floats
    cost: Floats
    low: Floats
    high: Floats
    ended: Floats
    ended_cost: Floats

    @classmethod
    def start(cls, dimensions: int) -> Self:
        """A swarm before the first iteration."""
        none, line = np.empty((0, dimensions)), np.empty(0)
        return cls(0, none, none, none, line, np.zeros(dimensions), np.ones(dimensions), none, line)

    @property
    def best(self) -> tuple[Floats, float]:
        """The best position (d,) of all rounds, and its cost."""
        places = np.concatenate((self.ended, self.own))
        costs = np.concatenate((self.ended_cost, self.cost))
        first = int(np.argmin(costs))
        return places[first], float(costs[first])

    def to_json(self) -> dict[str, Any]:
        """Serialise the swarm for `from_json`, bit for bit."""
        values = {f.name: np.asarray(getattr(self, f.name)).tolist() for f in fields(self)}
        # without a value a cost is infinite, which JSON does not know
        for name in ("cost", "ended_cost"):
            values[name] = [x if np.isfinite(x) else None for x in values[name]]
        return values

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> Self:
        """Parse a swarm written by `to_json`."""
        dimensions = len(values["low"])
        arrays = {f.name: np.array(values[f.name], np.float64) for f in fields(cls) if f.name != "step"}
        for name in ("cost", "ended_cost"):
            arrays[name] = np.where(np.isnan(arrays[name]), np.inf, arrays[name])
        for name in ("at", "velocity", "own", "ended"):
            arrays[name] = arrays[name].reshape(-1, dimensions)
        return cls(int(values["step"]), **arrays)


def advance_swarm(swarm: Swarm, cost: Cost, start: Floats, rules: SwarmRules, seed: int) -> Swarm:
    """One iteration: a new round if the last has ended, else one step of every particle.

    The first rounds search a random part of the box from random positions; `start` (d,) is included in the
    first round. Later ones search around the best positions of all earlier rounds, which they include.
    """
    number, iteration = divmod(swarm.step, rules.iterations + 1)
    rng = np.random.default_rng((seed, number, iteration))
    if iteration == 0:
        swarm = _begin_round(swarm, start, number < rules.random_rounds, rules, rng)
        costs = cost(swarm.at)
        return replace(swarm, step=swarm.step + 1, cost=costs)
    leader = swarm.own[np.argmin(swarm.cost)]
    r_personal, r_social = rng.random((2, *swarm.at.shape))
    velocity = (
        rules.inertia * rules.damping ** (iteration - 1) * swarm.velocity
        + rules.personal * r_personal * (swarm.own - swarm.at)
        + rules.social * r_social * (leader - swarm.at)
    )
    limit = rules.longest_step * (swarm.high - swarm.low)
    velocity = np.clip(velocity, -limit, limit)
    positions = np.clip(swarm.at + velocity, swarm.low, swarm.high)
    costs = cost(positions)
    better = costs < swarm.cost
    return replace(
        swarm,
        step=swarm.step + 1,
        at=positions,
        velocity=velocity,
        own=np.where(better[:, None], positions, swarm.own),
        cost=np.where(better, costs, swarm.cost),
    )


def _begin_round(
    swarm: Swarm, start: Floats, is_random: bool, rules: SwarmRules, rng: np.random.Generator
) -> Swarm:
    ended, ended_cost = swarm.ended, swarm.ended_cost
    if swarm.step:
        first = int(np.argmin(swarm.cost))
        ended = np.concatenate((ended, swarm.own[first : first + 1]))
        ended_cost = np.append(ended_cost, swarm.cost[first])
    anchors = start[None] if not len(ended) else ended[:0] if is_random else ended
    if is_random:
        low, high = rng.uniform(0.0, 0.5, len(start)), rng.uniform(0.5, 1.0, len(start))
    else:
        low, high = anchors.min(0) - MARGIN, anchors.max(0) + MARGIN
    low, high = (np.clip(np.array(x), 0.0, 1.0) for x in (low, high))
    if len(anchors):
        low, high = np.minimum(low, anchors.min(0)), np.maximum(high, anchors.max(0))
    positions = rng.uniform(low, high, (rules.particles, len(start)))
    anchors = anchors[: rules.particles]
    positions[: len(anchors)] = anchors
    return Swarm(
        swarm.step,
        positions,
        np.zeros_like(positions),
        positions,
        np.full(len(positions), np.inf),
        low,
        high,
        ended,
        ended_cost,
    )


def write_swarm(swarm: Swarm, problem: str) -> bytes:
    """A checkpoint: the swarm and the digest of its problem."""
    return json.dumps({"problem": problem, "swarm": swarm.to_json()}, allow_nan=False).encode()


def read_swarm(content: bytes, problem: str) -> Swarm:
    """The swarm of a checkpoint.

    Raises
    ------
    ParameterError `not_a_checkpoint`; `other_problem` if it belongs to a different search.
    """
    try:
        checkpoint = json.loads(content)
        swarm, searched = Swarm.from_json(checkpoint["swarm"]), str(checkpoint["problem"])
    except (ValueError, KeyError, TypeError) as error:
        raise ParameterError("not_a_checkpoint", "The file is no checkpoint of a tuning.") from error
    if searched != problem:
        raise ParameterError(
            "other_problem",
            "The checkpoint is of other trials, gains, constants or another version; start without it.",
        )
    return swarm
