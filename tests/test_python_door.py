"""The package for scientists: what it promises, that its example runs, and that importing it is cheap."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

import sagittal
from tests.data import ROOT

PAGE = (ROOT / "docs" / "reference" / "python.md").read_text("utf-8")
TUTORIAL = (ROOT / "docs" / "tutorials" / "python.md").read_text("utf-8")

PROMISED = {
    "Analysis": [
        "angle(name)", "angles", "estimator", "events", "notices", "parameter(name, side=None)", "parameters",
        "problem", "provenance", "quality", "strides",
    ],
    "Notice": [],
    "Recording": [],
    "SagittalError": [],
    "SimulatedWalk": ["angles", "events", "recording", "strides"],
    "analyse": "(recording, *, config=None, manifest=None, progress=None)",
    "read": "(*paths, manifest=None)",
    "simulate": "(script='comfortable', *, seed=0, height_m=1.75, rate_hz=100.0, segments=None)",
}  # fmt: skip
"""Public names: members of the classes of the package, arguments of the functions."""


def arguments(function: Any) -> str:
    """The signature without types and self."""
    found = inspect.signature(function)
    plain = [
        p.replace(annotation=inspect.Parameter.empty) for p in found.parameters.values() if p.name != "self"
    ]
    return str(found.replace(parameters=plain, return_annotation=inspect.Signature.empty))


def members(kind: type) -> list[str]:
    return [
        f"{name}{arguments(x)}" if inspect.isfunction(x) else name
        for name, x in sorted(vars(kind).items())
        if not name.startswith("_")
    ]


def test_the_public_names_and_signatures_are_these() -> None:
    assert sagittal.__all__ == sorted(PROMISED)
    assert dir(sagittal) == sagittal.__all__
    for name, promise in PROMISED.items():
        found = getattr(sagittal, name)
        if isinstance(promise, str):
            assert arguments(found) == promise
        elif promise:
            assert members(found) == promise
    with pytest.raises(AttributeError, match="no attribute 'plot'"):
        sagittal.plot  # noqa: B018


def test_every_public_name_is_documented() -> None:
    for name, promise in PROMISED.items():
        if isinstance(promise, str):
            assert f"| `{name}{promise}` |".replace("'", '"') in PAGE
            continue
        (row,) = (line for line in PAGE.splitlines() if line.startswith(f"| `{name}` |"))
        for member in promise:
            assert f"`{member.split('(')[0]}" in row


def test_importing_it_is_cheap() -> None:
    code = (
        "import sys, sagittal; heavy = {'numba', 'numpy', 'pyarrow', 'core'} & set(sys.modules);"
        "assert not heavy, heavy"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)


def test_the_example_of_the_tutorial_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    (example,) = re.findall(r"```python\n(.*?)```", TUTORIAL, re.DOTALL)
    names: dict[str, Any] = {}
    exec(example, names)  # noqa: S102
    walk = names["walk"]
    assert walk.problem is None
    assert walk.parameter("gait_speed_mps") == pytest.approx(1.3, abs=0.3)
    assert walk.strides.num_rows == len(names["lengths"]) > 20
    assert {"ic", "tc"} == set(walk.events["kind"].to_pylist())
    assert walk.angles.num_rows == len(names["knee_deg"]) == len(names["time_s"])
    row = next(
        r for r in walk.parameters.to_pylist() if (r["name"], r["side"]) == ("stride_length_m", "left")
    )
    assert row["mean"] == walk.parameter("stride_length_m", "left")
    assert np.isnan(walk.parameter("step_width_m", "left"))
    with pytest.raises(KeyError):
        walk.parameter("nothing")


@pytest.mark.slow
def test_a_simulated_walk_is_analysed_with_other_parameters_and_unknown_ones_are_named() -> None:
    made = sagittal.simulate(seed=1, segments=["pelvis"])
    told: list[str] = []
    walk = sagittal.analyse(
        made.recording,
        config={"strides": {"edge_strides": 2}},
        progress=lambda stage, share: told.append(stage),
    )
    assert told[0] == "timeline"
    assert walk.angles.num_rows == walk.strides.num_rows == 0
    assert walk.parameter("step_count") == pytest.approx(made.events.num_rows / 3, rel=0.2)
    assert walk.provenance != sagittal.analyse(made.recording).provenance
    with pytest.raises(sagittal.SagittalError, match=r"no config\.stride; expected one of"):
        sagittal.analyse(made.recording, config={"stride": {}})
    with pytest.raises(sagittal.SagittalError, match="does not exist"):
        sagittal.read("nowhere.csv")
