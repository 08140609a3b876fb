"""All parameters of a take: what is measured on what, and one column entry for every stride of the list."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from sagittal.core.events.result import Strides
from sagittal.core.events.strides import stride_list
from sagittal.core.frames import SIDES
from sagittal.core.parameters.measure import Tracks
from sagittal.core.parameters.spatial import NAMES as SPATIAL
from sagittal.core.parameters.spatial import Surface
from sagittal.core.parameters.stance import NAMES as STANCE
from sagittal.core.parameters.take import TakeFigures, gait_parameters, take_figures
from sagittal.core.parameters.trunk import NAMES as TRUNK
from sagittal.core.simulate import Walker, simulate
from sagittal.core.simulate.script import Stand, Straight
from tests.helpers.true_walks import true_tracks

STEP_S = 0.54


@cache
def tracks() -> Tracks:
    script = (Stand(1.0), Straight(5.5, 0.64, STEP_S), Stand(1.0))
    return true_tracks(simulate(script, Walker(), 3).truth)


@cache
def strides() -> Strides:
    return stride_list(tracks().events, tracks())


@cache
def figures() -> TakeFigures:
    x = tracks()
    return take_figures(strides(), x.angles, x, x.feet)


def means(found: TakeFigures) -> dict[str, list[float | None]]:
    said: dict[str, list[float | None]] = {}
    for p in found.parameters:
        said.setdefault(p.name, []).append(p.mean)
    return said


def test_without_angles_there_are_times_alone() -> None:
    found = take_figures(strides(), None, tracks(), tracks().feet)
    assert set(found.columns) < set(figures().columns)
    assert {p.name for p in found.parameters} == {*found.columns, "cadence_spm", "pci_pct"}
    assert found.parameters == figures().parameters[: len(found.parameters)]


def test_every_stride_has_an_entry_in_every_column() -> None:
    assert {len(column) for column in figures().columns.values()} == {len(strides().strides)}
    assert not all(s.excluded_reason is None for s in strides().strides)


@pytest.mark.parametrize("name", ["stride_time_s", "stride_length_m", "loading_pct", "hip_flexion_rom_deg"])
def test_a_parameter_is_the_mean_of_the_counted_entries_of_its_column(name: str) -> None:
    for side in SIDES:
        (figure,) = (p for p in figures().parameters if (p.name, p.side) == (name, side))
        entries = [
            value
            for stride, value in zip(strides().strides, figures().columns[name], strict=True)
            if stride.side == side and stride.excluded_reason is None
        ]
        assert figure.mean == pytest.approx(np.mean([v for v in entries if v is not None]))
        assert figure.n == len(entries)


def test_the_walk_is_the_one_that_was_planned() -> None:
    found = means(figures())
    assert found["stride_time_s"] == pytest.approx([2 * STEP_S] * 2, rel=0.03)
    assert found["stride_length_m"] == pytest.approx([1.28] * 2, rel=0.03)
    assert found["cadence_spm"] == pytest.approx([60.0 / STEP_S], rel=0.03)


def test_what_is_not_worn_has_reasons_and_no_values() -> None:
    x = tracks()
    bare = take_figures(strides(), x.angles)
    said = {p.name: p for p in bare.parameters}
    for name in (*SPATIAL, *STANCE, *TRUNK):
        if name != "toe_out_deg":
            assert said[name].mean is None, name
            assert said[name].reason, name
    assert "foot_pitch_ic_deg" not in bare.columns
    assert said["hip_flexion_rom_deg"].mean == pytest.approx(means(figures())["hip_flexion_rom_deg"][-1])


def test_a_belt_tells_the_length_of_a_stride() -> None:
    x = tracks()
    belt = means(take_figures(strides(), x.angles, x, x.feet, Surface("treadmill", 1.0)))
    assert belt["stride_length_m"] == pytest.approx(belt["stride_time_s"])


def test_the_parameters_alone_are_the_same() -> None:
    x = tracks()
    assert x.angles is not None
    assert gait_parameters(strides(), x.angles, x, x.feet) == figures().parameters
