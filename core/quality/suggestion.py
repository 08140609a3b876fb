"""Suggested segment labels for the upload page, from names or movement, to be confirmed by the user.

In walking the two legs swing alternately, so the rates and accelerations of neighbouring sensors on one leg
rise and fall together, those of the other leg in between; the foot rotates fastest, then the shank, the
thigh, and the pelvis least. Legs are numbered; core/quality/sides.py determines the left one if possible.
Observed in neura_walk (rates 3.3, 2.7, 1.9, 1.1 rad/s), qmt_fullbody and five simulated walks: accelerations
of a thigh correlate with its own shank with r ≥ 0.62, with the other one with r ≤ 0.05.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from sagittal.core.formats.aliases import segment_in, segment_named, side_in
from sagittal.core.frames import Floats, Segment
from sagittal.core.quality.sides import find_left_leg, smooth
from sagittal.core.signals.held_samples import is_complete
from sagittal.core.signals.recording import ImuStream, Recording

Part = Literal["foot", "shank", "thigh", "pelvis"]
LEG_PARTS: Final[tuple[Part, ...]] = ("foot", "shank", "thigh")
GRID_HZ: Final = 50.0
MOST_STRETCHED: Final = 20
"""Grid points per recorded sample; beyond, a clock has jumped and nothing is suggested [our choice]."""
SMOOTH_S: Final = 0.2
WALKING_RATE: Final = 0.5
"""Mean smoothed rate over all sensors, rad/s, above which the body walks [our choice]."""
SHORTEST_WALK_S: Final = 4.0
CENTRAL: Final = 0.42
"""Share of the fastest rate below which a sensor is on the trunk (neura_walk: pelvis .32, thigh .55)."""
ONE_BODY: Final = 0.95
"""Rates that agree this well come from one rigid body (shank and ankle .97 to .98, foot and ankle .86)."""


MARGIN: Final = 0.2
"""Difference of the two bonds below which nothing is said (smallest seen: 0.77) [our choice]."""


@dataclass(frozen=True)
class Suggestion:
    """A suggested label and its basis.

    Parameters
    ----------
    segment : None if it, or its side, is undetermined.
    basis : "declared" (manifest), "label" (file or sensor name), "movement", None = no suggestion.
    part : kind of segment without its side. leg : 1 or 2, sensors with the same number are on one leg.
    """

    segment: Segment | None = None
    basis: Literal["declared", "label", "movement"] | None = None
    part: str | None = None
    leg: int | None = None


def suggest(recording: Recording) -> dict[str, Suggestion]:
    """Suggest a segment for every sensor: as declared, else by its name, else by its movement."""
    out = {d: Suggestion() for d in recording.streams}
    assigned: set[Segment] = set()
    for device, segment in recording.segments.items():
        if device in out:
            out[device] = Suggestion(segment, "declared", _part(segment))
            assigned |= {segment} if segment else set()
    named = {d: _label(s) for d, s in recording.streams.items() if d not in recording.segments}
    for device, label in named.items():
        if label is not None and label not in assigned and list(named.values()).count(label) == 1:
            out[device] = Suggestion(label, "label", _part(label))
    if all(s.basis is None for s in out.values()):
        out |= _pair_of_feet(list(recording.streams)) or _by_movement(list(recording.streams.values()))
    return out


def suggest_segments(recording: Recording) -> dict[str, Segment | None]:
    """Device id → suggested segment, None if undetermined."""
    return {device: s.segment for device, s in suggest(recording).items()}


def _part(segment: Segment | None) -> str | None:
    return None if segment is None else segment.split("_")[0]


def _label(s: ImuStream) -> Segment | None:
    return segment_in(s.device_id) or segment_in(s.source)


def _pair_of_feet(devices: list[str]) -> dict[str, Suggestion]:
    """Two sensors whose names indicate only a side: assumed on the feet, as required for strides."""
    sides = {device: side_in(device) for device in devices}
    if len(sides) != 2 or set(sides.values()) != {"l", "r"}:
        return {}
    return {d: Suggestion(segment_named(f"foot_{side}"), "label", "foot") for d, side in sides.items()}


def _by_movement(streams: list[ImuStream]) -> dict[str, Suggestion]:
    """Sort distinct sensors into trunk and two legs; empty if the movement is not that of walking."""
    distinct = list({s.digest: s for s in reversed(streams) if s.gyr is not None}.values())[::-1]
    if len(distinct) < 7 or len({s.clock for s in distinct}) > 1:
        return {}
    motion = _on_grid(distinct)
    if motion is None:
        return {}
    acc, gyr = motion
    speed = np.linalg.norm(gyr - np.median(gyr, axis=1, keepdims=True), axis=2)
    rates = np.stack([smooth(x, SMOOTH_S, GRID_HZ) for x in speed])
    walking = smooth(rates.mean(axis=0), 1.0, GRID_HZ) > WALKING_RATE
    if np.count_nonzero(walking) < SHORTEST_WALK_S * GRID_HZ:
        return {}
    force = np.linalg.norm(acc, axis=2)
    shaking = np.stack([smooth(np.abs(np.diff(f, prepend=f[0])), SMOOTH_S, GRID_HZ) for f in force])
    if not (np.ptp(rates[:, walking], axis=1).all() and np.ptp(shaking[:, walking], axis=1).all()):
        return {}  # one of them does not measure
    energy = np.sqrt((rates[:, walking] ** 2).mean(axis=1))
    alike: Floats = np.asarray(np.corrcoef(rates[:, walking]), np.float64)
    bond = alike + np.asarray(np.corrcoef(shaking[:, walking]), np.float64)
    central = [i for i in range(len(distinct)) if energy[i] < CENTRAL * energy.max()]
    legs = _legs(energy, alike, bond, [i for i in range(len(distinct)) if i not in central])
    if legs is None:
        return {}
    pelvis = central[0] if len(central) == 1 else None
    left = None
    if pelvis is not None:
        feet = [max(leg, key=lambda i: energy[i]) for leg in legs]
        left = find_left_leg(acc[pelvis], gyr[pelvis], speed[feet[0]], speed[feet[1]], GRID_HZ)
    out = {s.device_id: Suggestion() for s in distinct}
    for number, leg in enumerate(legs, start=1):
        bodies = _bodies(leg, alike)
        if len(bodies) != len(LEG_PARTS):
            return {}
        bodies.sort(key=lambda body: -max(energy[i] for i in body))
        side = None if left is None else "l" if number == left else "r"
        for part, body in zip(LEG_PARTS, bodies, strict=True):
            nearest = min(body, key=lambda i: float(force[i].std()))
            segment = None if side is None else segment_named(f"{part}_{side}")
            out[distinct[nearest].device_id] = Suggestion(segment, "movement", part, number)
    if pelvis is not None:
        out[distinct[pelvis].device_id] = Suggestion("pelvis", "movement", "pelvis")
    return out


def _on_grid(streams: list[ImuStream]) -> tuple[Floats, Floats] | None:
    """Acceleration and rate (sensor, sample, 3) over the common range at `GRID_HZ`; None if too short."""
    start = max(float(s.t_s[0]) for s in streams)
    end = min(float(s.t_s[-1]) for s in streams)
    n = int((end - start) * GRID_HZ)
    if not SHORTEST_WALK_S * GRID_HZ <= n <= MOST_STRETCHED * max(len(s.t_s) for s in streams):
        return None
    grid = start + np.arange(n) / GRID_HZ
    acc: list[Floats] = []
    gyr: list[Floats] = []
    for s in streams:
        assert s.gyr is not None  # noqa: S101 - the caller chose streams with a gyroscope
        for signal, out in ((s.acc, acc), (s.gyr, gyr)):
            good = is_complete(signal)
            if not good.any():
                return None
            out.append(np.stack([np.interp(grid, s.t_s[good], axis[good]) for axis in signal.T], axis=1))
    return np.stack(acc), np.stack(gyr)


def _legs(
    energy: Floats, alike: Floats, bond: Floats, limbs: list[int]
) -> tuple[list[int], list[int]] | None:
    """Split leg sensors: the fastest of each leg, then each next one joins the leg with the higher
    correlation.
    """
    fastest = max(limbs, key=lambda i: energy[i])
    against = [i for i in limbs if energy[i] > 0.7 * energy[fastest] and alike[fastest, i] < 0.0]
    if not against:
        return None
    opposite = max(against, key=lambda i: energy[i])
    first, second = [fastest], [opposite]
    for i in sorted((i for i in limbs if i not in (fastest, opposite)), key=lambda i: -energy[i]):
        margin = bond[i, first].max() - bond[i, second].max()
        if abs(margin) < MARGIN:
            return None
        (first if margin > 0 else second).append(i)
    return (first, second) if len(first) == len(second) else None


def _bodies(leg: list[int], alike: Floats) -> list[list[int]]:
    """Group the sensors of a leg that are on the same rigid body."""
    bodies: list[list[int]] = []
    for i in leg:
        body = next((b for b in bodies if all(alike[i, j] > ONE_BODY for j in b)), None)
        if body is None:
            bodies.append([i])
        else:
            body.append(i)
    return bodies
