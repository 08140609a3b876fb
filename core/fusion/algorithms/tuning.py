"""Gains of one algorithm fitted to recordings with a reference, and validated on others.

Nazarahari 2021, section 4.2.3: a particle swarm minimises the mean RMS error over the training trials. The
error is the total one with a magnetometer and the inclination without, where the heading is arbitrary: both
are independent of the order of Euler angles, whose sum is used in the thesis.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, astuple, dataclass
from itertools import product
from typing import Any, Final

import numpy as np

from sagittal.core.errors import EstimationError, ParameterError, SignalError
from sagittal.core.frames import Floats
from sagittal.core.fusion.algorithms.benchmark import ReferenceTrial, find_rest, run_trial, score_orientation
from sagittal.core.fusion.algorithms.filter import find_algorithm
from sagittal.core.fusion.algorithms.gain_space import GainSpace, choose_scheme, gains_to_json
from sagittal.core.fusion.algorithms.parameters import AlgorithmGains
from sagittal.core.fusion.algorithms.schemes import Scheme
from sagittal.core.fusion.algorithms.swarm import Swarm, SwarmRules, advance_swarm, read_swarm, write_swarm
from sagittal.core.message import Message

Keep = Callable[[bytes, float, str], None]
"""(checkpoint, share done 0 to 1, sentence): told after every iteration."""

ForEach = Callable[[Callable[[Any], float], Iterable[Any]], Iterable[float]]
"""Results of a function for each of some arguments, in their order."""

LEAST_GAIN: Final = 0.01
"""Share by which the error on the validating trials falls before the tuned gains are recommended."""


@dataclass(frozen=True, eq=False)
class TrialSplit:
    """Training trials, and validation trials."""

    train: tuple[ReferenceTrial, ...]
    validate: tuple[ReferenceTrial, ...]

    def __post_init__(self) -> None:
        if not self.train or not self.validate:
            raise ParameterError(
                "no_validation",
                Message(
                    "{train} trials to fit to and {validate} to judge by; at least one of each is "
                    "needed. Gains that are judged on what they were fitted to look too good.",
                    train=len(self.train),
                    validate=len(self.validate),
                ),
            )
        names_by_digest: dict[str, str] = {}
        for trial in (*self.train, *self.validate):
            for mark in (trial.name, trial.sha256):
                if mark in names_by_digest:
                    raise ParameterError(
                        "trial_twice",
                        Message(
                            "{mark} and {name} are the same recording; leave one out.",
                            mark=names_by_digest[mark],
                            name=trial.name,
                        ),
                    )
                names_by_digest[mark] = trial.name

    @classmethod
    def by_name(cls, trials: Sequence[ReferenceTrial], validate: Collection[str]) -> TrialSplit:
        """Split trials by the names of the validation trials.

        Raises
        ------
        ParameterError `no_such_trial`, `no_validation`, `trial_twice`.
        """
        if unknown := sorted(set(validate) - {t.name for t in trials}):
            raise ParameterError(
                "no_such_trial",
                Message(
                    "No trial {unknown}; there are {join}.",
                    unknown=", ".join(unknown),
                    join=", ".join(t.name for t in trials) or "none",
                ),
            )
        return cls(
            tuple(t for t in trials if t.name not in validate), tuple(t for t in trials if t.name in validate)
        )


@dataclass(frozen=True)
class TuningResult:
    """Result of a tuning.

    Parameters
    ----------
    start, gains : by name, before and after. trained, validated : trial → RMS error in ° with the gains
    before and after, None if the filter diverged. data : trial → sha256 of its samples. data_sha256 : of all
        of them and of the split. rules : constants of the swarm.
    improved : the mean over the validation trials decreased by more than one percent. verdict : that in
        words.
    """

    algorithm: str
    magnetometer: bool
    start: Mapping[str, Any]
    gains: Mapping[str, Any]
    trained: Mapping[str, tuple[float | None, float | None]]
    validated: Mapping[str, tuple[float | None, float | None]]
    improved: bool
    verdict: str
    data: Mapping[str, str]
    data_sha256: str
    seed: int
    rules: Mapping[str, float]
    code_version: str

    def to_json(self) -> dict[str, Any]:
        """The result as a JSON object."""
        return asdict(self)


class GainTuner:
    """One search, ready to run; equal arguments give bit-identical gains on any number of cores.

    Parameters
    ----------
    algorithm : of `ALGORITHMS`. split : see `TrialSplit`. start : initial gains, None = the defaults.
        scheme : of the adaptive gains, None = that of `start`. magnetometer : None = if the algorithm
        supports it and every trial has one. code_version : recorded in the result and the checkpoint.

    Raises
    ------
    ParameterError `no_such_algorithm`, `nothing_to_tune`. SignalError `no_rest`, `no_reference`.
    EstimationError `no_magnetometer`.
    """

    def __init__(
        self,
        algorithm: str,
        split: TrialSplit,
        *,
        start: AlgorithmGains | None = None,
        scheme: Scheme | None = None,
        magnetometer: bool | None = None,
        seed: int = 0,
        rules: SwarmRules | None = None,
        code_version: str = "",
    ) -> None:
        algorithm_entry = find_algorithm(algorithm)
        without = [t.name for t in (*split.train, *split.validate) if not t.has_magnetometer]
        uses_mag = algorithm_entry.magnetometer != "unused" and magnetometer is not False and not without
        if not uses_mag and (algorithm_entry.magnetometer == "needed" or (magnetometer and without)):
            reason = (
                Message("{without} have none", without=", ".join(without))
                if without
                else "it is told to go without"
            )
            raise EstimationError(
                "no_magnetometer",
                Message(
                    "{label} is set to use a magnetometer, but {why}.",
                    label=algorithm_entry.label,
                    why=reason,
                ),
            )
        params = algorithm_entry.gains() if start is None else start
        self._name, self._split, self._seed, self._version = algorithm, split, seed, code_version
        self._before, self._uses_mag, self._rules = params, uses_mag, rules or SwarmRules()
        levels = params if scheme is None else choose_scheme(params, scheme, magnetometer=uses_mag)
        self._space = GainSpace(levels, magnetometer=uses_mag)
        for trial in (*split.train, *split.validate):
            find_rest(trial)
            if not trial.scored.any():
                raise SignalError(
                    "no_reference",
                    Message("{name} has no reference during movement; exclude it.", name=trial.name),
                )
        halves = [("train", t) for t in split.train] + [("validate", t) for t in split.validate]
        self._data = {t.name: t.sha256 for _, t in halves}
        self._data_sha256 = _digest(sorted((half, t.sha256) for half, t in halves))
        searched = (algorithm, uses_mag, gains_to_json(self._space.params), self._data_sha256)
        self._problem = _digest((*searched, seed, astuple(self._rules), code_version))

    def read_checkpoint(self, content: bytes) -> Swarm:
        """The swarm from a checkpoint of this same search; raises ParameterError, see `read_swarm`."""
        return read_swarm(content, self._problem)

    def run(self, keep: Keep, swarm: Swarm | None = None, each: ForEach = map) -> TuningResult:
        """Run the search to its end.

        Parameters
        ----------
        swarm : a stored one to resume, None = from the start. each : `map`, or that of a thread pool: the
            filters release the GIL while they run.
        """

        def score(gains: Sequence[AlgorithmGains], trials: Sequence[ReferenceTrial]) -> Floats:
            return np.reshape(list(each(self._score, product(gains, trials))), (len(gains), -1))

        def cost(points: Floats) -> Floats:
            gains = [self._space.decode(x) for x in points]
            return np.asarray(score(gains, self._split.train).mean(axis=1))

        start = self._space.encode(self._space.params)
        swarm = swarm or Swarm.start(len(self._space))
        # on one thread, so that compiling is done once
        self._score((self._before, self._split.train[0]))
        while swarm.step < self._rules.steps:
            swarm = advance_swarm(swarm, cost, start, self._rules, self._seed)
            keep(write_swarm(swarm, self._problem), swarm.step / self._rules.steps, self._say(swarm))
        tuned = self._space.decode(swarm.best[0])
        candidates = (self._before, tuned)
        return self._report(
            tuned, score(candidates, self._split.train), score(candidates, self._split.validate)
        )

    def _score(self, task: tuple[AlgorithmGains, ReferenceTrial]) -> float:
        """RMS error in rad; inf if the filter diverges."""
        gains, trial = task
        try:
            q = run_trial(self._name, trial, gains, magnetometer=self._uses_mag)
        except EstimationError:
            return math.inf
        score = score_orientation(q, trial)
        error = score.total if self._uses_mag else score.inclination
        return error if math.isfinite(error) else math.inf

    def _say(self, swarm: Swarm) -> str:
        number = min((swarm.step - 1) // (self._rules.iterations + 1) + 1, self._rules.rounds)
        best = _say_error(swarm.best[1], 3)
        return Message(
            "Round {number} of {rounds}, {best} on the trials it is fitted to.",
            number=number,
            rounds=self._rules.rounds,
            best=best,
        )

    def _report(self, tuned: AlgorithmGains, trained: Floats, validated: Floats) -> TuningResult:
        old, new = validated.mean(axis=1)
        improved = bool(new < (1.0 - LEAST_GAIN) * old)
        words = f"{_say_error(old, 2)} before, {_say_error(new, 2)} after, on trials not fitted to"
        worse = [t.name for t, a, b in zip(self._split.validate, *validated, strict=True) if b > a]
        verdict = (
            f"Better: {words}."
            if improved
            else Message("No improvement: {words}. Keep the initial gains.", words=words)
        )
        if improved and worse:
            verdict += f" Worse on {', '.join(worse)}."
        return TuningResult(
            algorithm=self._name,
            magnetometer=self._uses_mag,
            start=gains_to_json(self._before),
            gains=gains_to_json(tuned),
            trained=_pairs(self._split.train, trained),
            validated=_pairs(self._split.validate, validated),
            improved=improved,
            verdict=verdict,
            data=self._data,
            data_sha256=self._data_sha256,
            seed=self._seed,
            rules=asdict(self._rules),
            code_version=self._version,
        )


def _say_error(error: float, digits: int) -> str:
    """An RMS error in rad as text; a filter that diverged has none."""
    return f"{math.degrees(error):.{digits}f}°" if math.isfinite(error) else "diverged"


def _pairs(trials: Sequence[ReferenceTrial], errors: Floats) -> dict[str, tuple[float | None, float | None]]:
    def degrees(x: float) -> float | None:
        return round(math.degrees(x), 4) if math.isfinite(x) else None

    return {t.name: (degrees(a), degrees(b)) for t, a, b in zip(trials, *errors.tolist(), strict=True)}


def _digest(value: object) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()
