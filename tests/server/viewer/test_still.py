"""The drawing of the figure on paper."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from sagittal.core.frames import Side
from sagittal.server.viewer.still import HEIGHT_PX, draw_still
from tests.server import walk


def outlines(svg: str) -> list[tuple[str, np.ndarray]]:
    """Class and points (n, 2) px of each part, from back to front."""
    matches = re.findall(r'<path class="([^"]+)" d="M([^z]+)z"', svg)
    return [(css, np.array([p.split() for p in d.split("L")], float)) for css, d in matches]


@pytest.mark.parametrize(("near", "far", "side"), [("st-l", "st-r", "left"), ("st-r", "st-l", "right")])
def test_the_leg_asked_for_is_in_front_and_the_feet_on_the_floor(near: str, far: str, side: Side) -> None:
    svg = draw_still(walk.poses(4.0), 2.0, side, "Contact")
    assert svg is not None
    parts = outlines(svg)
    order = [css.split()[0] for css, _ in parts]
    assert len(order) - 1 - order[::-1].index(near) > order.index(far)
    legs = np.concatenate([points for css, points in parts if css.startswith(("st-l", "st-r"))])
    floor = float(re.search(r'class="ax"[^>]* y1="([\d.]+)"', svg)[1])  # type: ignore[index]
    assert abs(legs[:, 1].max() - floor) < 4.0
    assert legs[:, 1].max() <= HEIGHT_PX


def test_nothing_is_drawn_where_a_sensor_was_lost() -> None:
    poses = walk.poses(4.0)
    assert draw_still(replace(poses, valid=np.zeros_like(poses.valid)), 2.0, "left", "Contact") is None
    assert draw_still(replace(poses, q={}, p={}), 2.0, "left", "Contact") is None
