"""Set-up mistakes on a correct trial: labels, alignment, axes, units and signs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import permutations, product

import numpy as np

from sagittal.core.agreement import Agreement, AgreementParams
from sagittal.core.agreement.agree import compare_sensors
from sagittal.core.agreement.exchange import SensorExchange, find_exchange
from sagittal.core.formats.reader import correct_streams
from sagittal.core.frames import Floats, Segment
from sagittal.core.setup import SetupRepair, propose_repair
from sagittal.core.setup.propose import propose_labels
from sagittal.core.signals.recording import Recording
from sagittal.core.timeline import synchronise

SIGNED: tuple[Floats, ...] = tuple(
    np.eye(3)[list(order)] * np.array(signs)[:, None]
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
)
"""The 48 ways to name and sign three axes; 24 of them are turns, the others mirror."""

TURNS: tuple[Floats, ...] = tuple(m for m in SIGNED if np.linalg.det(m) > 0.0)
MIRRORS: tuple[Floats, ...] = tuple(m for m in SIGNED if np.linalg.det(m) < 0.0)


def change_axes(
    recording: Recording, segments: Segment, acc: Floats | float = 1.0, gyr: Floats | float = 1.0
) -> Recording:
    """One sensor whose accelerometer and gyroscope give their values times a matrix (3, 3) or a number."""
    device = next(d for d, s in recording.segments.items() if s == segments)
    x = recording.streams[device]
    a, g = (m * np.eye(3) if isinstance(m, float) else m for m in (acc, gyr))
    changed = replace(x, acc=x.acc @ a.T, gyr=None if x.gyr is None else x.gyr @ g.T, mag=None, quat=None)
    return replace(recording, streams={**recording.streams, device: changed})


def exchange_labels(recording: Recording, names: Mapping[Segment, Segment]) -> Recording:
    """Sensors with wrong labels: true segment → stated one."""
    stated = {d: None if s is None else names.get(s, s) for d, s in recording.segments.items()}
    return replace(recording, segments=stated)


def apply_repair(recording: Recording, repair: SetupRepair) -> Recording:
    """Recording read with the repaired manifest."""
    streams, _ = correct_streams(recording.streams, repair.corrections)
    segments = {d: repair.segments.get(d, s) for d, s in recording.segments.items()}
    return replace(recording, streams=streams, segments=segments)


def look_at(recording: Recording) -> tuple[SetupRepair | None, SensorExchange | None]:
    """Proposal and automatic corrections of the stage `agreement`, without later stages."""
    uniform, params = synchronise(recording), AgreementParams()
    repair = propose_repair(recording, uniform, agreement=params)
    if repair is not None:
        return repair, None
    joints, terms = compare_sensors(uniform, params.joints)
    exchange = (
        find_exchange(terms, joints, uniform.rate_hz, params.joints, params.exchange) if joints else None
    )
    return propose_labels(uniform, Agreement(uniform, exchange=exchange)), exchange
