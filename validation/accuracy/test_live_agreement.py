"""Typical clinic mistakes during streaming: delay and sensor of the notices, and agreement with the file.

Each run covers a third of the mistakes on two walks; `--write-figures` runs all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from sagittal.core.agreement import check_agreement
from sagittal.core.errors import Notice
from sagittal.core.frames import Segment
from sagittal.core.pipeline import PipelineConfig
from sagittal.core.signals.recording import UniformRecording
from sagittal.core.simulate import PATIENTS, SCRIPTS, simulate_scenario
from sagittal.core.timeline import synchronise
from tests.helpers.live_agreement import find_standings, listen, walk_again
from tests.helpers.perturbations import find_middle, slip_sensor
from tests.helpers.walks import neura_recording, only, simulated
from validation.accuracy.test_events_trunk_qmt import take as qmt_take
from validation.accuracy.test_perturbations import LEG_SENSORS, MUST, PEOPLE, QMT, WORN, cases_of, seven
from validation.figures import record
from validation.marks import sample, whole_only

TAKES = ("neura_walk", "neura_walk, lower", "healthy", "hemiparetic")
EACH = [
    pytest.param(name, marks=() if name in ("neura_walk", "hemiparetic") else whole_only) for name in TAKES
]
LAGS = ("40 ms late", "100 ms late")
SLIPS = {"slips +15°": 15.0, "slips −15°": -15.0, "slips +10°": 10.0, "slips −10°": -10.0}

WALKS = 3
"""Times that the ten seconds of neura_walk are walked where a sensor slips in the middle of the second."""

CODES = frozenset(("sensor_late", "clocks_disagree", "sensors_exchanged", "sensor_slipped"))

LATEST_S = {"late": 16.0, "exchanged": 12.0, "slips": 14.0}
"""Seconds of walking after the first step, or after the slip."""


LOWER_SHANK: dict[str, Segment] = {"00B40C44": "shank_l", "00B40C47": "shank_r"}
"""Sensors of neura_walk above the ankles, a second place of the shank."""


@cache
def take(name: str) -> UniformRecording:
    if name == "neura_walk":
        return synchronise(seven(neura_recording()))
    if name == "neura_walk, lower":
        result = neura_recording()
        retained = {d: None if s in LOWER_SHANK.values() else s for d, s in result.segments.items()}
        return synchronise(seven(replace(result, segments={**retained, **LOWER_SHANK})))
    return synchronise(seven(simulate_scenario(name, seed=5).recording))


@cache
def stood(name: str) -> tuple[int, ...]:
    return find_standings(take(name))[:1]


def walked_until(recording: UniformRecording, since_s: float, until_s: float) -> float:
    """Seconds between two moments in which the legs moved, pauses of up to a second counted."""
    moves = np.linalg.norm(recording.sensors["shank_r"].gyr, axis=1) > 1.0
    near = np.convolve(moves, np.ones(round(recording.rate_hz)), "same") > 0
    part = (recording.t_s >= since_s) & (recording.t_s < until_s)
    return float(np.count_nonzero(near & part) / recording.rate_hz)


@dataclass(frozen=True)
class Heard:
    """Live notices of one mistake, with the amount of walking before them, and notices of the file."""

    told: frozenset[tuple[str, str | None]]
    after_s: float | None
    file: frozenset[tuple[str, str | None]]


def name_of(notice: Notice) -> tuple[str, str | None]:
    # the words name all sensors of an exchange
    return notice.code, notice.message.split(". ")[0] if "exchanged" in notice.code else notice.sensor


def hear(recording: UniformRecording, standing: tuple[int, ...], since_s: float) -> Heard:
    notices = [(t, n) for t, n in listen(recording, standing)[1] if n.code in CODES]
    file = [n for n in check_agreement(recording).recording.notices if n.code in CODES]
    return Heard(
        frozenset(name_of(n) for _, n in notices),
        walked_until(recording, since_s, notices[0][0]) if notices else None,
        frozenset(name_of(n) for n in file),
    )


@cache
def late_or_exchanged(name: str) -> Mapping[tuple[str, str], Heard]:
    right = take(name)
    return {
        (kind, case): hear(make(right), stood(name), stood(name)[0] / right.rate_hz)
        for n, kind in enumerate((*LAGS, "exchanged"))
        for case, make in sample(tuple(cases_of(name, kind).items()), 3, n)
    }


@cache
def slipped(name: str) -> Mapping[tuple[str, Segment], Heard]:
    right, result = take(name), {}
    at_s = find_middle(right)
    if name.startswith("neura_walk"):
        at_s += right.t_s[-1] + 1.0 / right.rate_hz
        right = walk_again(right, WALKS)
    for n, (kind, by_deg) in enumerate(SLIPS.items()):
        for segment in sample(LEG_SENSORS, 3, n):
            if not (name == "healthy" and segment.endswith("_r")):
                wrong = slip_sensor(right, segment, np.radians(by_deg), at_s)
                result[kind, segment] = hear(wrong, stood(name), at_s)
    return result


@pytest.mark.parametrize("name", EACH)
def test_late_and_exchanged_sensors_are_told_as_by_the_file(name: str) -> None:
    for key, x in late_or_exchanged(name).items():
        assert x.told == x.file, key
        assert x.told, key
        assert x.after_s is not None
        assert x.after_s < LATEST_S["late" if "late" in key[0] else "exchanged"], key


@pytest.mark.parametrize("name", EACH)
def test_a_slip_is_told_of_the_right_sensor(name: str) -> None:
    result = slipped(name)
    for (kind, segment), x in result.items():
        assert x.told <= {("sensor_slipped", segment)}, (kind, segment)
    large = [x for (kind, _), x in result.items() if "15°" in kind]
    share = 0.75 if name.startswith("neura_walk") else 1.0
    assert sum(bool(x.told) for x in large) >= share * len(large) > 0


@cache
def right_walks() -> Mapping[str, UniformRecording]:
    walks = {x: take(x) for x in TAKES} | {"qmt_fullbody": qmt_take(QMT)}
    for name in sample(list(SCRIPTS), 6):
        simulation = simulated(name, 1)[0]
        walks[f"{name}, script"] = only(simulation, *(s for s in WORN if s in simulation.sensors))
    for name, seed, height in sample(PEOPLE, 6):
        scene = simulate_scenario(name, seed=seed, height_m=height)
        walks[f"{name}, {height} m"] = synchronise(seven(scene.recording))
    for k, name in sample(list(enumerate(sorted(PATIENTS))), 6, 1):
        walks[f"{name}, again"] = synchronise(seven(simulate_scenario(name, seed=300 + k).recording))
    return walks


def test_right_walks_are_accused_of_nothing() -> None:
    messages = {}
    for name, walk in right_walks().items():
        notices = listen(walk, find_standings(walk))[1]
        if notices:
            messages[name] = [(n.code, n.sensor) for _, n in notices]
    assert messages == {}


@whole_only
def test_write_down_the_figures() -> None:
    rows = []
    for kind in (*LAGS, "exchanged", *SLIPS):
        row = [kind]
        for name in TAKES:
            every = slipped(name) if kind in SLIPS else late_or_exchanged(name)
            result = [x for (k, _), x in every.items() if k == kind]
            final_after_s = [x.after_s for x in result if x.after_s is not None]
            row.append(f"{len(final_after_s)} of {len(result)}")
            row.append(f"{np.median(final_after_s):.0f} ({max(final_after_s):.0f})" if final_after_s else "–")
            row.append(f"{sum(x.told == x.file for x in result)} of {len(result)}")
        rows.append(row)
    record(
        "Mistakes of a clinic, live",
        ["mistake", *(f"{x}: {y}" for x in TAKES for y in ("told", "after s", "as the file"))],
        rows,
        "Streamed; told of the right sensor, median (largest) seconds of walking after the first step, slips "
        "after they happened; as the file: the same sensors under the same codes as in the analysis of the "
        "whole take. neura_walk is real; lower: its sensors above the ankles as shanks. For slips it is "
        "walked three times in a row and they happen in the second walk. "
        f"Never another sensor; {len(right_walks())} right takes are told nothing of.",
    )


def test_the_limits_are_those_of_a_file() -> None:
    from sagittal.core.agreement.params import LiveAgreementParams

    assert LiveAgreementParams().agreement == PipelineConfig().agreement
    assert set(LAGS) <= set(MUST)
