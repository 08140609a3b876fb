"""Colours of the scene, sRGB."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal

import numpy as np

Rgb = tuple[int, int, int]
Tint = Literal["left", "right", "body", "ring"]

TINTS: Final[Mapping[bool, Mapping[Tint, Rgb]]] = {
    False: {
        "left": (0xD5, 0x5E, 0x00),
        "right": (0x00, 0x72, 0xB2),
        "body": (0x9A, 0xA4, 0xAE),
        "ring": (0xA9, 0xD6, 0xF2),
    },
    True: {
        "left": (0xF5, 0x87, 0x3A),
        "right": (0x56, 0xB4, 0xE9),
        "body": (0x8C, 0x97, 0xA3),
        "ring": (0x0E, 0x3A, 0x57),
    },
}
"""Dark → colours of the parts; the leg pairs are --left and --right of the page's base.css. Two rings around
the right shank distinguish the sides without colour.
"""

GHOST: Final[Mapping[bool, Rgb]] = {False: (0x5B, 0x7C, 0x99), True: (0x8F, 0xAE, 0xC8)}
"""Dark → colour of a ghost, the grey-blue of its curves; its legs are distinguished by position."""

BACKGROUND: Final[Mapping[bool, Rgb]] = {False: (0xF9, 0xFA, 0xFB), True: (0x16, 0x1C, 0x22)}
"""Dark → colour behind the figure."""

FLOOR: Final[Mapping[bool, tuple[Rgb, Rgb]]] = {
    False: ((0xE2, 0xE6, 0xEA), (0xC2, 0xCA, 0xD2)),
    True: ((0x2A, 0x32, 0x3B), (0x45, 0x50, 0x5C)),
}
"""Dark → lines of the floor's cells and sections."""


def to_linear_rgb(colour: Rgb) -> Rgb:
    """Convert sRGB to the linear RGB that viser expects per instance of a batch (0 to 255).

    Colours per mesh are interpreted as sRGB, colours per instance are not: unconverted they look washed out.
    Formula: IEC 61966-2-1.
    """
    c = np.asarray(colour) / 255.0
    out = np.where(c > 0.04045, ((c + 0.055) / 1.055) ** 2.4, c / 12.92)
    r, g, b = (round(float(v) * 255) for v in out)
    return r, g, b
