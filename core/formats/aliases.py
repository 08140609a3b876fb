"""Segment names used by vendors and laboratories, also in file names."""

from __future__ import annotations

import re
from typing import Final, cast

from sagittal.core.frames import SEGMENTS, Segment

_WHOLE: Final[dict[str, str]] = {
    "pelvis": "pelvis", "sacrum": "pelvis", "hip": "pelvis", "hips": "pelvis", "lumbar": "pelvis",
    "lowerback": "pelvis", "chest": "chest", "sternum": "chest", "torso": "chest", "trunk": "chest",
    "t8": "chest", "thorax": "chest", "lb": "pelvis", "lf": "foot_l", "rf": "foot_r",
}  # fmt: skip
_LEG: Final[dict[str, str]] = {
    "thigh": "thigh", "femur": "thigh", "upperleg": "thigh", "upleg": "thigh",
    "shank": "shank", "tibia": "shank", "lowerleg": "shank", "lowleg": "shank", "calf": "shank",
    "ankle": "shank",
    "foot": "foot", "calcn": "foot", "shoe": "foot", "toes": "foot",
}  # fmt: skip
_SIDE: Final[dict[str, str]] = {"left": "l", "l": "l", "right": "r", "r": "r"}
_FILLER: Final = re.compile(r"(imu|sensor)$")


def segment_named(name: str) -> Segment | None:
    """Segment for a name or alias ("tibia_r_imu", "RightLowerLeg", "Left Foot", "LTibia"), else None."""
    if name in SEGMENTS:
        return name
    flat = _FILLER.sub("", re.sub(r"[\s_\-./]+", "", name).lower())
    if flat in _WHOLE:
        return cast("Segment", _WHOLE[flat])
    for side, letter in _SIDE.items():
        for part in (flat.removeprefix(side), flat.removesuffix(side)):
            if part != flat and part in _LEG:
                return cast("Segment", f"{_LEG[part]}_{letter}")
    return None


def side_in(text: str) -> str | None:
    """Side, "l" or "r", named in a text; None if none or both."""
    sides = {_SIDE[word] for word in re.split(r"[\s_\-./]+", text.lower()) if word in _SIDE}
    return sides.pop() if len(sides) == 1 else None


def segment_in(text: str) -> Segment | None:
    """Segment named in a file name or column label, None if none or more than one."""
    stem = re.sub(
        r"\.(txt|csv|tsv|gz|parquet)$", "", text.replace("\\", "/").rsplit("/", 1)[-1], flags=re.IGNORECASE
    )
    words = [w for w in re.split(r"[\s_\-.]+", stem) if w]
    segments = {
        s
        for n in (1, 2, 3)
        for i in range(len(words) - n + 1)
        if (s := segment_named("_".join(words[i : i + n])))
    }
    return segments.pop() if len(segments) == 1 else None
