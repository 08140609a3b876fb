"""Rendered content of a 3D view in a real browser."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from sagittal.core.frames import SIDES, Side
from sagittal.server.viewer.colours import TINTS

CHROMIUM = Path("/usr/bin/chromium")
ARGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]

PATIENCE_MS = 60_000
"""A picture without a graphics card, beside other work."""


def shot(frame: Any) -> np.ndarray:
    """Picture (h, w, 3) of an element."""
    png = frame.screenshot(timeout=PATIENCE_MS)
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


def until(frame: Any, enough: Callable[[dict[Side, int]], bool], dark: bool = False) -> np.ndarray:
    """Pictures of an element until the pixels of both leg colours are as wanted, or fail."""
    counts: dict[Side, int] = {}
    for _ in range(60):
        observations = shot(frame)
        counts = {side: int(pixels_of(observations, TINTS[dark][side]).sum()) for side in SIDES}
        if enough(counts):
            return observations
    raise AssertionError(f"leg colours were not drawn as wanted: {counts}")


def pixels_of(picture: np.ndarray, rgb: tuple[int, int, int]) -> np.ndarray:
    """Which pixels (h, w) are of this hue, whatever the light does to their brightness."""
    colour = np.asarray(rgb, float) / np.linalg.norm(rgb)
    pixels = picture.astype(float)
    length = np.linalg.norm(pixels, axis=-1)
    return np.asarray((length > 60) & (pixels @ colour > 0.97 * length))
