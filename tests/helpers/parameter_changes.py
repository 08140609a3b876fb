"""Single pipeline parameters, alternative values, and their effect on a stage."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable, Iterator, Mapping
from enum import Enum
from typing import Any, Final, Literal, get_args, get_origin, get_type_hints

import numpy as np

from sagittal.core.errors import SagittalError
from sagittal.core.pipeline import PipelineConfig, TakeAnalysis
from sagittal.core.pipeline.recipes import ACTIVITY, SIGNALS, choose_recipe, run_stages, say_nothing
from sagittal.core.pipeline.stages import PipelineStage
from sagittal.core.signals.recording import Recording

Path = tuple[str, ...]
"""Names of fields, `[key]` of mappings and `[place]` in tuples, from the configuration down to one value."""

FACTORS: Final = (1.5, 1 / 1.5, 4.0, 0.25, 30.0, 1 / 30.0, 1000.0, 0.001)
"""By which a number is multiplied, the smallest change first."""


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One value of the configuration.

    Parameters
    ----------
    default : in `PipelineConfig()`. hint : the type that its dataclass declares.
    """

    path: Path
    default: object
    hint: object

    @property
    def name(self) -> str:
        """As the table writes it: `calibration.heading.speed[0]`."""
        return "".join(p if p.startswith("[") else f".{p}" for p in self.path).removeprefix(".")


def list_parameters(value: object | None = None, path: Path = ()) -> Iterator[Parameter]:
    """All parameters; those of a mapping by key and those of a tuple of numbers by place."""
    value = PipelineConfig() if value is None else value
    hints = get_type_hints(type(value))
    for f in dataclasses.fields(value):  # type: ignore[arg-type]
        yield from _list_below(getattr(value, f.name), hints[f.name], (*path, f.name))


def _list_below(value: object, hint: object, path: Path) -> Iterator[Parameter]:
    if dataclasses.is_dataclass(value):
        yield from list_parameters(value, path)
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from _list_below(item, type(item), (*path, f"[{key}]"))
    elif isinstance(value, tuple) and all(isinstance(x, int | float) for x in value):
        for i, item in enumerate(value):
            yield from _list_below(item, type(item), (*path, f"[{i}]"))
    else:
        yield Parameter(path, value, hint)


def replace_value(config: Any, path: Path, new: object) -> Any:
    """The same with one value changed.

    Raises
    ------
    ParameterError of the dataclass that refuses it.
    """
    if not path:
        return new
    first, remainder = path[0], path[1:]
    if isinstance(config, Mapping):
        key = first[1:-1]
        return type(config)({**config, key: replace_value(config[key], remainder, new)})  # type: ignore[call-arg]
    if isinstance(config, tuple):
        index = int(first[1:-1])
        return (*config[:index], replace_value(config[index], remainder, new), *config[index + 1 :])
    return dataclasses.replace(config, **{first: replace_value(getattr(config, first), remainder, new)})


def list_changes(parameter: Parameter) -> list[object]:
    """Other values that its dataclasses accept, the nearest first."""
    accepted = []
    for new in _propose(parameter.default, parameter.hint):
        try:
            replace_value(PipelineConfig(), parameter.path, new)
        except (SagittalError, ValueError):
            continue
        accepted.append(new)
    return accepted


def _propose(default: object, hint: object) -> list[object]:
    choices = [c for h in (hint, *get_args(hint)) if get_origin(h) is Literal for c in get_args(h)]
    if choices:
        return [c for c in choices if c != default]
    if isinstance(default, bool):
        return [not default]
    if isinstance(default, int):
        near = (
            default + 1,
            default - 1,
            2 * default,
            default // 2,
            4 * default,
            default // 10,
            default // 30,
            0,
        )
        return list(dict.fromkeys(n for n in near if n != default))
    if isinstance(default, float):
        return [default * f for f in FACTORS] if default else [0.1, -0.1, 1.0]
    if default is None:
        return [10.0, 1.0, 0.1]
    if isinstance(default, tuple):
        return [default[1:], default[:1], default[::-1]]
    return [f"other_{default}"]


def digest(*results: object) -> str:
    """Hash of results, arrays to the bit; parameters that a result keeps for later are no part of it."""
    sha256 = hashlib.sha256()
    for result in results:
        _feed(sha256, result)
    return sha256.hexdigest()[:16]


def _feed(observations: Any, value: object) -> None:
    if isinstance(value, np.ndarray | np.generic):
        array = np.ascontiguousarray(value)
        observations.update(f"{array.dtype}{array.shape}".encode() + array.tobytes())
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        if type(value).__name__.endswith("Params"):
            return
        for f in dataclasses.fields(value):
            observations.update(f.name.encode())
            _feed(observations, getattr(value, f.name))
    elif isinstance(value, Mapping):
        for key, item in value.items():
            _feed(observations, key)
            _feed(observations, item)
    elif isinstance(value, list | tuple):
        observations.update(f"[{len(value)}".encode())
        for item in value:
            _feed(observations, item)
    elif isinstance(value, set | frozenset):
        _feed(observations, sorted(map(repr, value)))
    elif value is None or isinstance(value, str | bytes | int | float | bool | Enum):
        observations.update(repr(value).encode() + b";")
    elif hasattr(value, "__dict__") or hasattr(type(value), "__slots__"):
        held = getattr(value, "__dict__", None) or {
            n: getattr(value, n) for n in getattr(type(value), "__slots__", ())
        }
        _feed(observations, dict(sorted(held.items())))
    else:
        raise TypeError(f"cannot hash a {type(value).__name__}")


class StagedTake:
    """Trial before each of its stages, computed on demand."""

    def __init__(self, recording: Recording, config: PipelineConfig) -> None:
        self.config = config
        self._reached = TakeAnalysis(recording, config)
        self._ahead = list(ACTIVITY if recording.protocol == "activity" else SIGNALS)
        self._before: dict[str, tuple[TakeAnalysis, PipelineStage]] = {}
        self._usual: dict[str, str] = {}

    def list_stages(self) -> list[str]:
        """Names of all stages that the take goes through; runs them."""
        self._run_before(None)
        return list(self._before)

    def observe(self, stage: str, config: PipelineConfig) -> str:
        """Digest of what one stage gives with other parameters for it alone."""
        if stage not in self._before:
            self._run_before(stage)
        initial, run = self._before[stage]
        return _run_one(dataclasses.replace(initial, config=config), run)[1]

    def observe_usual(self, stage: str) -> str:
        """The same with the parameters of the take."""
        if stage not in self._usual:
            self._usual[stage] = self.observe(stage, self.config)
        return self._usual[stage]

    def _run_before(self, name: str | None) -> None:
        while name not in self._before:
            if not self._ahead:
                recipe = choose_recipe(self._reached)
                self._ahead = [s for s in recipe if s.name not in self._before]
                if not self._ahead:
                    return
            stage = self._ahead.pop(0)
            self._before[stage.name] = (self._reached, stage)
            if stage.name != name:
                reached, self._usual[stage.name] = _run_one(self._reached, stage)
                if reached is None:
                    self._ahead = []
                    return
                self._reached = reached
            else:
                self._ahead.insert(0, stage)
                return


class DirectCall:
    """One function of the chain on input made by hand, as if it were the only stage of a take."""

    STAGE: Final = "call"

    def __init__(self, call: Callable[[PipelineConfig], object]) -> None:
        self.config = PipelineConfig()
        self._call = call

    def list_stages(self) -> list[str]:
        """Its only one."""
        return [self.STAGE]

    def observe(self, stage: str, config: PipelineConfig) -> str:
        """Digest of the function's result."""
        assert stage == self.STAGE
        try:
            return digest(self._call(config))
        except SagittalError as error:
            return digest(error.code, error.message, error.sensor, error.t_s)

    def observe_usual(self, stage: str) -> str:
        """The same with the default parameters."""
        return self.observe(stage, self.config)


def _run_one(earlier: TakeAnalysis, stage: PipelineStage) -> tuple[TakeAnalysis | None, str]:
    try:
        final_stages = run_stages(earlier, (stage,), say_nothing)
    except SagittalError as error:
        return None, digest(error.code, error.message, error.sensor, error.t_s)
    getattrs = [getattr(final_stages, name) for name in stage.results]
    return final_stages, digest(
        *getattrs,
        final_stages.setup,
        final_stages.calibration_score,
        final_stages.problem,
        final_stages.stopped_at,
    )
