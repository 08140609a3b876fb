"""Feet that pitch like feet: stand, walk, stand; with the extremes of the pitch known exactly."""

from __future__ import annotations

import numpy as np

from sagittal.core.frames import R_NEUTRAL, Bools, Floats, Segment
from sagittal.core.fusion.orientations import Orientations
from sagittal.core.rotation import about, from_matrix, multiply

# foot pitch over the gait cycle in degrees, a0, cos1, sin1, … (fitted to the healthy walker)
SERIES = (
    -12.92, 20.98, 20.75, 9.70, -15.10, -2.76, -2.50, 1.19, -1.40, 0.23, -1.54, -0.18, -0.33, 0.69, -0.65,
)  # fmt: skip

FINE = np.linspace(0.0, 1.0, 20001)


def cycle_pitch(phase: Floats) -> Floats:
    """Pitch in rad at a phase (0 to 1) of the gait cycle."""
    pitch = np.full(np.shape(phase), SERIES[0])
    for i, (c, s) in enumerate(zip(SERIES[1::2], SERIES[2::2], strict=True), 1):
        pitch = pitch + c * np.cos(2 * np.pi * i * phase) + s * np.sin(2 * np.pi * i * phase)
    return np.asarray(np.radians(pitch))


PHASE_IC = float(FINE[np.argmax(cycle_pitch(FINE))])
PHASE_TC = float(FINE[np.argmin(cycle_pitch(FINE))])


def foot_pitch(t: Floats, start_s: float, cycles: int, stride_s: float, scale: float = 1.0) -> Floats:
    """Pitch in rad of a foot that stands, walks `cycles` strides from mid-stance (phase 0.2), and stands."""
    phase = np.clip((t - start_s) / stride_s, 0.0, cycles) + 0.2
    ends = np.clip(np.minimum(t - start_s, start_s + cycles * stride_s - t) / (0.1 * stride_s), 0.0, 1.0)
    return scale * cycle_pitch(phase % 1.0) * ends


def extremes(start_s: float, cycles: int, stride_s: float) -> tuple[Floats, Floats]:
    """True times of TC and IC of `foot_pitch`."""
    whole = np.arange(cycles, dtype=np.float64) * stride_s + start_s
    return np.asarray(whole + (PHASE_TC - 0.2) * stride_s), np.asarray(
        whole + ((PHASE_IC - 0.2) % 1.0) * stride_s
    )


def orientation(pitch: Floats, heading: Floats | float = 0.0) -> Floats:
    """Foot orientations (n, 4) of a pitch and a heading in rad."""
    turned = multiply(about(2, np.broadcast_to(heading, pitch.shape)), about(1, -pitch))
    return multiply(turned, from_matrix(R_NEUTRAL))


def orientations(
    rate_hz: float,
    feet: dict[Segment, Floats],
    valid: dict[Segment, Bools] | None = None,
    heading: Floats | float = 0.0,
) -> Orientations:
    """Orientations of feet given by their pitch."""
    n = len(next(iter(feet.values())))
    masks = {foot: np.ones(n, np.bool_) for foot in feet} | (valid or {})
    q = {foot: orientation(pitch, heading) for foot, pitch in feet.items()}
    return Orientations(np.arange(n) / rate_hz, rate_hz, q, masks, "test")


def walk(
    rate_hz: float = 100.0,
    cycles: int = 12,
    stride_s: float = 1.1,
    scale: float = 1.0,
    valid: dict[Segment, Bools] | None = None,
) -> Orientations:
    """Two feet half a stride apart, 2 s of standing before and after; the right foot steps first."""
    t = np.arange(round((4.0 + (cycles + 1) * stride_s) * rate_hz)) / rate_hz
    feet: dict[Segment, Floats] = {
        "foot_r": foot_pitch(t, 2.0, cycles, stride_s, scale),
        "foot_l": foot_pitch(t, 2.0 + stride_s / 2, cycles, stride_s, scale),
    }
    return orientations(rate_hz, feet, valid)
