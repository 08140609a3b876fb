"""Parsing of a free-text sensor placement into a direction.

The manifest's `mounting` is free text per segment, e.g. "sacrum, face backwards". The face is the sensor's
outer side, its +z axis on all supported devices; "x forward" and the like name another axis.
"""

from __future__ import annotations

import re
from typing import Literal

import numpy as np

from sagittal.core.frames import Floats, Segment

FACE = np.array([0.0, 0.0, 1.0])
"""Outward axis of a sensor's housing in sensor coordinates (Xsens MTw and DOT: z away from the skin)."""

AXES = {"x": np.array([1.0, 0.0, 0.0]), "y": np.array([0.0, 1.0, 0.0]), "z": FACE}
Way = Literal["forward", "left", "back", "right"]

WAYS = {"forward": 0.0, "front": 0.0, "left": 90.0, "back": 180.0, "rear": 180.0, "right": -90.0}
"""Horizontal way → angle in degrees from anterior, counter-clockwise seen from above."""

_PHRASE = re.compile(
    r"(?<![\w+-])(?:(?P<sign>[+-])?(?P<axis>[xyz])(?:[- ]axis)?|face|facing|faces)\s+(?:to\s+the\s+)?"
    r"(?P<way>forward|front|left|back|rear|right)(?:s|wards?)?\b",
    re.IGNORECASE,
)


def read_declared_direction(text: str) -> tuple[Floats, float] | None:
    """Sensor axis (3,) and the angle from anterior in rad it points to, or None if the text does not specify
    one.

    >>> declared_direction("sacrum, face backwards")[1]
    3.141592653589793
    """
    phrase = _PHRASE.search(text)
    if phrase is None:
        return None
    axis = AXES[(phrase["axis"] or "z").lower()] * (-1.0 if phrase["sign"] == "-" else 1.0)
    return axis, float(np.radians(WAYS[phrase["way"].lower()]))


def say_other_way(text: str, way: Way) -> str:
    """The same text with the named direction replaced.

    >>> say_other_way("sacrum, face backwards", "forward")
    'sacrum, face forward'
    """
    phrase = _PHRASE.search(text)
    return text if phrase is None else text[: phrase.start("way")] + way + text[phrase.end() :]


def read_declared_angle(text: str, R_vertical: Floats, segment: Segment) -> float | None:
    """Angle in rad of the anterior axis in the sensor's rest frame, from a declared placement.

    Parameters
    ----------
    R_vertical : (3, 3) rows of the vertical frame; its x is the rest frame's x, its z the rest frame's −y.

    Returns
    -------
    None if the text specifies no direction, or an axis within 30° of vertical.
    """
    declared = read_declared_direction(text)
    if declared is None:
        return None
    axis, way = declared
    v = R_vertical @ axis
    horizontal = complex(v[0], -v[2])
    if abs(horizontal) < 0.5:
        return None
    return float(np.angle(horizontal * np.exp(-1j * way)))
