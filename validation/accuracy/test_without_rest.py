"""Real walks without any rest: the walk alone gives the results of the whole trial.

Each trial is cut to its longest stretch without a rest, 0.3 s from it, so it starts and ends in motion. Foot
posture is known no better than two standings agree, and its pitch no better than its path fits its rests:
foot strike is judged in trials whose standings agree within the limit at both feet and which suppress no
distances, and over all trials in the mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest

from sagittal.core.frames import FOOT, Segment
from sagittal.core.pipeline import TakeAnalysis, analyse
from sagittal.core.signals.recording import Recording
from sagittal.core.signals.rest import find_rest_windows, index_window
from sagittal.core.timeline import synchronise
from tests.helpers import mobgap
from tests.helpers.ipol import WALKS
from tests.helpers.real_takes import NAMES, UNCUT, analyse_take, cut_recording, read_take
from validation.figures import record

MARGIN_S = 0.3
CADENCE_PCT, SWING_PCT, PITCH_DEG = 2.0, 2.0, 3.0


def without_rest(recording: Recording) -> Recording:
    """The longest stretch between two rests."""
    uniform = synchronise(recording)
    edges = [0.0, *(x for w in find_rest_windows(uniform) for x in w), float(uniform.t_s[-1])]
    start, end = max(zip(edges[::2], edges[1::2], strict=True), key=lambda x: x[1] - x[0])
    segment_names = [s for d, s in recording.streams.items() if recording.segments.get(d) is not None]
    first = max(float(s.t_s[0]) for s in segment_names)
    return cut_recording(recording, first + start + MARGIN_S, first + end - MARGIN_S)


def stand_apart_deg(recording: Recording, foot: Segment) -> float:
    """How far two standings of one take differ in a foot, degrees; 0 with only one of them."""
    uniform = synchronise(recording)
    up = []
    for window in find_rest_windows(uniform):
        mean = uniform.sensors[foot].acc[index_window(window, uniform.rate_hz)].mean(axis=0)
        up.append(mean / np.linalg.norm(mean))
    return max((float(np.degrees(np.arccos(min(1.0, a @ b)))) for a, b in combinations(up, 2)), default=0.0)


@dataclass(frozen=True, eq=False)
class Pair:
    """A take and the same without its rests."""

    whole: TakeAnalysis
    walk: TakeAnalysis

    def differences(self, name: str) -> list[float]:
        """Walk minus whole, of each side or of the take, where both have the parameter."""
        old, new = (
            {p.side: p.mean for p in a.parameters if p.name == name and p.mean is not None}
            for a in (self.whole, self.walk)
        )
        return [new[s] - old[s] for s in old if s in new]

    def means(self, name: str) -> list[float]:
        """Of the whole take, of the sides that `differences` has."""
        joint_sides = {p.side for p in self.walk.parameters if p.name == name and p.mean is not None}
        return [
            p.mean for p in self.whole.parameters
            if p.name == name and p.mean is not None and p.side in joint_sides
        ]  # fmt: skip


@cache
def pair(name: str) -> Pair:
    return Pair(analyse_take(name), analyse(without_rest(read_take(name))))


def relative_pct(p: Pair, name: str) -> list[float]:
    return [100.0 * d / m for d, m in zip(p.differences(name), p.means(name), strict=True)]


@pytest.mark.parametrize("name", NAMES)
def test_the_walk_alone_gives_cadence_swing_and_foot_strike(name: str) -> None:
    p = pair(name)
    assert p.walk.problem is None
    assert p.walk.calibration is not None
    assert p.walk.calibration.posture == "walking"
    assert "from_walking" in {n.code for n in p.walk.notices}
    (cadence,) = relative_pct(p, "cadence_spm")
    assert abs(cadence) <= CADENCE_PCT
    swing = p.differences("swing_pct")
    assert len(swing) == 2
    assert max(map(abs, swing)) <= SWING_PCT
    pitch = p.differences("foot_pitch_ic_deg")
    assert len(pitch) == 2
    if is_judged(name):
        assert max(map(abs, pitch)) <= PITCH_DEG


def is_judged(name: str) -> bool:
    """The whole take knows the pitch of both feet as well as the limit asks."""
    recording = read_take(name)
    apart = max(stand_apart_deg(recording, foot) for foot in FOOT.values())
    return apart <= PITCH_DEG and "distances_withheld" not in {n.code for n in pair(name).whole.notices}


def test_foot_strike_is_right_over_all_takes_and_most_of_them_are_judged() -> None:
    each = [d for name in NAMES for d in pair(name).differences("foot_pitch_ic_deg")]
    assert abs(np.mean(each)) <= 1.5
    assert np.std(each) <= PITCH_DEG
    assert sum(map(is_judged, NAMES)) >= len(NAMES) // 2


def test_what_seven_sensors_give_of_a_walk_alone_holds_on_a_real_person() -> None:
    p = pair("neura_walk")
    assert max(map(abs, p.differences("knee_flexion_rom_deg"))) <= 2.0
    assert max(map(abs, p.differences("hip_flexion_rom_deg"))) <= 4.0
    assert max(map(abs, p.differences("ankle_dorsiflexion_rom_deg"))) <= 5.0
    assert max(map(abs, relative_pct(p, "stride_length_m"))) <= 2.0
    levels = {x.name: x.reason for x in p.walk.parameters if x.name.endswith("_max_swing_deg")}
    assert levels
    assert set(levels.values()) == {"no_standing"}
    assert {x.reason for x in p.walk.parameters if x.name == "toe_out_deg"} == {"no_standing"}


WORN: tuple[tuple[Segment, ...], ...] = (
    ("pelvis",),
    ("foot_l", "foot_r"),
    ("shank_l", "shank_r"),
    ("pelvis", "thigh_l", "thigh_r"),
    ("pelvis", "foot_l", "foot_r"),
    ("shank_l", "shank_r", "foot_l", "foot_r"),
    ("pelvis", "shank_l", "shank_r", "foot_l", "foot_r"),
    ("pelvis", "thigh_l", "thigh_r", "shank_l", "shank_r", "foot_l", "foot_r"),
)


@cache
def given(segment_names: tuple[Segment, ...]) -> frozenset[tuple[str, str | None]]:
    """Parameters with a value of qmt_fullbody without rests and with some of its sensors."""
    recording = without_rest(read_take("qmt_fullbody"))
    segments = {d: s if s in segment_names else None for d, s in recording.segments.items()}
    analysis = analyse(replace(recording, segments=segments))
    return frozenset((p.name, p.side) for p in analysis.parameters if p.mean is not None)


OTHER_SOURCE = {"step_count", "step_time_cv_pct"}
"""Of a trunk's steps, where no foot tells them."""


@pytest.mark.parametrize(
    ("few", "many"), [(a, b) for a in WORN for b in WORN if set(a) < set(b)], ids=lambda x: "+".join(x)
)
def test_more_sensors_never_give_less(few: tuple[Segment, ...], many: tuple[Segment, ...]) -> None:
    sides = {name for name, _ in given(many)}
    lost = {
        (name, side)
        for name, side in given(few) - given(many)
        if name not in OTHER_SOURCE and (side is not None or name not in sides)
    }
    assert lost == set()


@pytest.mark.parametrize("worn", WORN, ids="+".join)
def test_every_set_of_sensors_gives_a_cadence(worn: tuple[Segment, ...]) -> None:
    assert ("cadence_spm", None) in given(worn)


@pytest.mark.parametrize("trial", mobgap.TRIALS[:2])
def test_a_lower_back_alone_has_its_cadence_without_rest(trial: tuple[str, str]) -> None:
    recording = mobgap.recording(trial)
    (period,) = mobgap.periods(trial)
    cut = cut_recording(recording, period.start_s, period.end_s + 0.3)
    if cut.streams["LowerBack"].t_s[-1] < 5.0:
        cut = cut_recording(recording, period.end_s - 5.2, period.end_s + 0.3)
    by_name = {p.name: p.mean for p in analyse(cut).parameters}
    assert by_name["cadence_spm"] == pytest.approx(period.cadence_spm, rel=0.05)


def test_write_down_the_figures() -> None:
    rows = []
    groups: list[tuple[str, Sequence[str]]] = [(name, (name,)) for name in UNCUT]
    groups += [
        (f"ipol_walks, subject {s}", [w for w in WALKS if w.startswith(s)])
        for s in sorted({w.split("-")[0] for w in WALKS})
    ]
    for title, names in groups:
        pairs = [pair(n) for n in names]
        cadence = [x for p in pairs for x in relative_pct(p, "cadence_spm")]
        swing = [x for p in pairs for x in p.differences("swing_pct")]
        pitch = [x for p in pairs for x in p.differences("foot_pitch_ic_deg")]
        length = [x for p in pairs for x in relative_pct(p, "stride_length_m")]
        apart = max(stand_apart_deg(read_take(n), foot) for n in names for foot in FOOT.values())
        rows.append(
            [
                title,
                str(len(names)),
                f"{np.max(np.abs(cadence)):.1f}",
                f"{np.mean(swing):+.1f} ({np.max(np.abs(swing)):.1f})",
                f"{np.mean(pitch):+.1f} ({np.max(np.abs(pitch)):.1f})",
                f"{apart:.1f}",
                f"{np.mean(length):+.1f} ({np.max(np.abs(length)):.1f})" if length else "withheld",
            ]
        )
    record(
        "Without rest",
        [
            "recording", "takes", "cadence %, worst", "swing points, mean (worst)",
            "foot strike °, mean (worst)", "two standings apart °, worst", "stride length %, mean (worst)",
        ],
        rows,
        "The take with every rest cut out against the whole take, each foot of each take. Limits: 2 %, "
        "2 points, 3° where both feet's standings agree within 3° and the whole take withholds no distances. "
        "Flexion ranges of neura_walk: hip within 4°, knee 2°, ankle 5°.",
    )  # fmt: skip
