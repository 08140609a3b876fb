"""Find trials that depend on parameters: `python -m tests.helpers.find_parameter_changes [take[:stage,…] …]`

Adds a line to `tests/helpers/pipeline_parameters.csv` for each parameter that has none and changes a result.
Lines can also be written by hand: parameter, trial (tests/helpers/parameter_takes.py), stage, other value as
JSON; the sweep of tests/core/pipeline/test_config.py verifies them.
"""

from __future__ import annotations

import dataclasses
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final

from sagittal.core.pipeline import PipelineConfig
from tests.helpers.parameter_calls import CALLS
from tests.helpers.parameter_changes import (
    DirectCall,
    Parameter,
    StagedTake,
    list_changes,
    list_parameters,
    replace_value,
)
from tests.helpers.parameter_table import Row, read_rows, write_rows
from tests.helpers.parameter_takes import TAKES, stage_take

FURTHEST: Final = 5
"""So many of the furthest values without effect, and the nearer ones are not tried."""


def separate(value: Any) -> Any:
    """The same configuration of objects that no two places share."""
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return value
    return dataclasses.replace(
        value, **{f.name: separate(getattr(value, f.name)) for f in dataclasses.fields(value)}
    )


@contextmanager
def noting_reads(config: PipelineConfig) -> Iterator[set[str]]:
    """Names of the fields that are read of a separate configuration, leaves and what holds them."""
    names: dict[int, str] = {}
    kinds: set[type] = set()

    def name(value: Any, path: str) -> None:
        names[id(value)] = path
        kinds.add(type(value))
        for f in dataclasses.fields(value):
            lower = getattr(value, f.name)
            if dataclasses.is_dataclass(lower):
                name(lower, f"{path}.{f.name}".removeprefix("."))

    name(config, "")
    read: set[str] = set()

    def note(self: object, attribute: str) -> Any:
        path = names.get(id(self))
        if path is not None and not attribute.startswith("__"):
            read.add(f"{path}.{attribute}".removeprefix("."))
        return object.__getattribute__(self, attribute)

    for kind in kinds:
        kind.__getattribute__ = note  # type: ignore[assignment,method-assign]
    try:
        yield read
    finally:
        for kind in kinds:
            del kind.__getattribute__


def find_reads(take: StagedTake | DirectCall, stage: str) -> set[str]:
    """Names of the parameters that a stage reads of the take's configuration."""
    config = separate(take.config)
    with noting_reads(config) as read:
        take.observe(stage, config)
    return read


def find_change(take: StagedTake | DirectCall, stage: str, parameter: Parameter) -> object | None:
    """Nearest other value that changes the stage's result; None if even the furthest does not."""
    changes = list_changes(parameter)
    quiet = 0
    for new in reversed(changes):
        tells = _tells(take, stage, parameter, new)
        if tells:
            return next(new for new in changes if _tells(take, stage, parameter, new))
        quiet += tells is not None
        if quiet == FURTHEST and isinstance(new, float):
            break
    return None


def _tells(take: StagedTake | DirectCall, stage: str, parameter: Parameter, new: object) -> bool | None:
    """Whether a value changes something; None where the stage cannot work with it."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            observe = take.observe(stage, replace_value(take.config, parameter.path, new))
    except Exception:  # noqa: BLE001  a value beyond what the stage can work with shows nothing
        return None
    return observe != take.observe_usual(stage)


def search(names: list[str]) -> None:
    """Complete the table by what these takes show."""
    for text in names:
        name, _, only = text.partition(":")
        rows = {row.parameter: row for row in read_rows()}
        try:
            take = stage_take(name)
            stages = take.list_stages()
        except Exception as error:  # noqa: BLE001
            print(f"{name}: {error!r}", flush=True)
            continue
        new_rows = []
        for stage in only.split(",") if only else stages:
            read, missing, outcome = find_reads(take, stage), [], 0
            for parameter in list_parameters():
                if parameter.name in rows or parameter.name.partition("[")[0] not in read:
                    continue
                new = find_change(take, stage, parameter)
                if new is None:
                    missing.append(parameter.name)
                    continue
                new_rows.append(Row(parameter.name, name, stage, new))
                rows[parameter.name] = new_rows[-1]
                outcome += 1
            if outcome or missing:
                print(f"{name} {stage}: {outcome} found, unmoved: {' '.join(missing)}", flush=True)
        write_rows({row.parameter: row for row in (*read_rows(), *new_rows)}.values())


if __name__ == "__main__":
    search(sys.argv[1:] or [*TAKES, *CALLS])
    known = {row.parameter for row in read_rows()}
    print("Without effect:", *(p.name for p in list_parameters() if p.name not in known), sep="\n  ")
