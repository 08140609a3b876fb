"""Declared placements contradicted by the walk: detection and proposals."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from sagittal.core.calibration.declared import propose_mountings
from sagittal.core.calibration.mounting import WAYS, Way, say_other_way
from sagittal.core.frames import SEGMENTS, Segment
from sagittal.core.rotation import rotate
from sagittal.core.setup.repair import SetupRepair
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.simulate import WalkTruth
from tests.helpers.walks import cut, only, simulated

NEAR = np.cos(np.radians(20.0))
"""Of an axis that points one of the four ways."""

LEGS = tuple(s for s in SEGMENTS if s not in ("chest", "pelvis"))


def right_words(truth: WalkTruth, segment: Segment) -> tuple[str, Way, float]:
    """The sensor axis nearest to one of the four ways, that way, and the cosine between them."""
    best: tuple[float, str, Way] | None = None
    for k, name in enumerate("xyz"):
        points = rotate(truth.mounts[segment].q_segment_sensor, np.eye(3)[k])
        for way in get_args(Way):
            a = np.radians(WAYS[way])
            # z of a segment is to the right
            along = float(points @ [np.cos(a), 0.0, -np.sin(a)])
            if best is None or along > best[0]:
                best = along, name, way
    assert best is not None
    return f"strap, {best[1]} {best[2]}", best[2], best[0]


def turn_words(text: str, way: Way, key: int) -> str:
    ways: tuple[Way, ...] = get_args(Way)
    return say_other_way(text, ways[(ways.index(way) + key) % 4])


def declare(take: UniformRecording, truth: WalkTruth, key: int) -> UniformRecording:
    """Every mounting declared, `by` quarter turns wrong."""
    message: dict[str, str] = {}
    for segment in take.sensors:
        text, way, _ = right_words(truth, segment)
        message[segment] = turn_words(text, way, key)
    return replace(take, mounting=message)


@pytest.mark.slow
@pytest.mark.parametrize("by", [1, 2, 3])
def test_a_declaration_turned_by_quarters_is_put_right(by: int) -> None:
    take, truth = simulated("comfortable", 3)
    mountings = propose_mountings(declare(take, truth, by))
    assert mountings is not None
    assert not mountings.is_sure
    right = {s: right_words(truth, s) for s in take.sensors}
    # whose axis lies between two ways is left alone
    clear = {s for s in LEGS if right[s][2] > NEAR}
    assert len(clear) >= 3
    assert clear <= set(mountings.mounting)
    assert dict(mountings.mounting) == {s: x[0] for s, x in right.items() if s in mountings.mounting}
    assert propose_mountings(replace(take, mounting=dict(mountings.mounting))) is None


def test_right_declarations_and_none_are_left_alone() -> None:
    take, truth = simulated("comfortable", 3)
    assert propose_mountings(declare(take, truth, 0)) is None
    assert propose_mountings(take) is None
    assert (
        propose_mountings(replace(take, mounting=dict.fromkeys(map(str, LEGS), "with the new strap"))) is None
    )


def test_without_a_walk_nothing_is_said() -> None:
    take, truth = simulated("comfortable", 3)
    stood = cut(only(take, "foot_l", "shank_l"), 0.0, 5.0)
    assert propose_mountings(declare(stood, truth, 2)) is None


def test_a_manifest_keeps_its_other_words() -> None:
    repair = SetupRepair("mounting", ("said",), np.inf, mounting={"foot_l": "x forward"})
    assert repair.can_be_applied
    initial = {"mounting": {"Left foot": "x back", "pelvis": "sacrum, face backwards"}, "protocol": "walk"}
    assert repair.complete_manifest(initial) == {
        "mounting": {"pelvis": "sacrum, face backwards", "foot_l": "x forward"},
        "protocol": "walk",
    }
    assert repair.to_json()["repair"] == {"mounting": {"foot_l": "x forward"}}
