"""The configuration: every parameter of every stage is in it, in its hash, of some stage, and matters."""

from __future__ import annotations

import dataclasses
import importlib
import pkgutil
import typing
from collections.abc import Iterator

import pytest

from sagittal import core
from sagittal.core.errors import ParameterError
from sagittal.core.events.consensus import ConsensusParams
from sagittal.core.pipeline import SQUAT, TRUNK_ONLY, WALK, PipelineConfig
from sagittal.core.pipeline.config import REMOVED, override_config
from sagittal.core.pipeline.recipes import ACTIVITY, BY_TRUNK
from tests.helpers.parameter_changes import list_parameters, replace_value
from tests.helpers.parameter_table import read_rows

ELSEWHERE = ("sagittal.core.online", "sagittal.core.simulate", "sagittal.core.fusion.self_calibrating")
"""Samples as they come have a configuration of their own (`OnlineParams`), so have a simulation and a filter
that no stage runs."""

LIVE = "Live"
"""So begin the names of those that stand beside their twin for files."""


def declared() -> Iterator[type]:
    """Every dataclass of parameters that a module of core defines."""
    for module in pkgutil.walk_packages(core.__path__, "sagittal.core."):
        if module.name.startswith(ELSEWHERE):
            continue
        result = importlib.import_module(module.name)
        for name, kind in vars(result).items():
            if not name.endswith("Params") or name.startswith(LIVE) or not isinstance(kind, type):
                continue
            if kind.__module__ == module.name:
                yield kind


def reachable(kind: type) -> set[type]:
    """The dataclass and those of its fields, their fields, and so on."""
    hints = typing.get_type_hints(kind)
    lower = {hints[f.name] for f in dataclasses.fields(kind) if dataclasses.is_dataclass(hints[f.name])}
    return {kind}.union(*(reachable(k) for k in lower))


def leaves(value: object) -> Iterator[tuple[str, ...]]:
    """Paths of all plain values of a configuration."""
    if not dataclasses.is_dataclass(value):
        yield ()
        return
    for f in dataclasses.fields(value):
        yield from ((f.name, *path) for path in leaves(getattr(value, f.name)))


def test_parameters_of_every_stage_are_in_the_config() -> None:
    kinds = set(declared())
    assert len(kinds) > 20
    assert {k.__name__ for k in kinds - reachable(PipelineConfig)} == set()
    assert all(k.__dataclass_params__.frozen for k in kinds)  # type: ignore[attr-defined]


def test_every_part_of_the_config_is_read_by_a_stage_that_says_so() -> None:
    read = {name for stage in (*WALK, *TRUNK_ONLY, *SQUAT, *BY_TRUNK, *ACTIVITY) for name in stage.reads}
    assert read == {f.name for f in dataclasses.fields(PipelineConfig)}


def test_every_single_parameter_changes_the_hash() -> None:
    config = PipelineConfig()
    paths = [p for p in leaves(config) if p not in (("detector",), ("poses", "estimator"))]
    numbers = [p for p in paths if isinstance(value_at(config, p), int | float) and p]
    assert len(numbers) > 100
    digests = set()
    for path in numbers:
        try:
            digests.add(shifted(config, path).digest)
        except ParameterError:
            continue
    assert config.digest not in digests
    assert len(digests) > 100
    assert PipelineConfig().digest == config.digest


def value_at(value: typing.Any, path: tuple[str, ...]) -> typing.Any:
    return value_at(getattr(value, path[0]), path[1:]) if path else value


def shifted(value: typing.Any, path: tuple[str, ...]) -> typing.Any:
    """The configuration with one number a millionth larger, a switch turned."""
    if not path:
        return not value if isinstance(value, bool) else value * (1 + 1e-6) + 1e-9
    return dataclasses.replace(value, **{path[0]: shifted(getattr(value, path[0]), path[1:])})


def test_a_detector_that_does_not_exist_is_named() -> None:
    with pytest.raises(ParameterError, match="no detector 'marianni'; expected one of gouwanda"):
        ConsensusParams(presets=("marianni",))
    with pytest.raises(ParameterError, match="not one of foot_contact, foot_pitch, consensus"):
        PipelineConfig(detector="best")  # type: ignore[arg-type]


def test_every_parameter_has_a_row_that_says_what_it_changes() -> None:
    """`python -m tests.helpers.find_parameter_changes` looks for a row of a new one."""
    names = {p.name for p in list_parameters()}
    rows = read_rows()
    assert len({row.parameter for row in rows}) == len(rows)
    assert {row.parameter for row in rows} == names


@pytest.mark.sweep
@pytest.mark.parametrize("name", sorted({row.take for row in read_rows()}))
def test_every_parameter_changes_what_a_stage_gives(name: str) -> None:
    from tests.helpers.parameter_takes import stage_take  # slow imports

    take = stage_take(name)
    unmoved = [
        row.parameter
        for row in read_rows()
        if row.take == name
        and take.observe(row.stage, replace_value(take.config, row.path, row.value))
        == take.observe_usual(row.stage)
    ]
    assert unmoved == []


def test_stored_settings_that_name_a_removed_parameter_mean_the_same_without() -> None:
    stored = {"contacts": {"stop_share": 0.3, "step_m": 0.2}, "quality": {"rest": {"bias": 0.1}}}
    chosen = override_config(PipelineConfig(), stored)
    assert chosen == override_config(PipelineConfig(), {"contacts": {"step_m": 0.2}})
    target = {f"config.{p.name}".split("[")[0] for p in list_parameters()}
    assert not [name for name in REMOVED if any(f"{x}.".startswith(f"{name}.") for x in target)]
