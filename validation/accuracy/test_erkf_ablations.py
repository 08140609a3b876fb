"""Contribution of each ErKF correction, and accuracy of its parameter sets, on walks with exact truth.

Alignment, positions and body are known, leaving the filter's own error. Sensors have MEMS errors; headings
start from standing with all segments facing ahead. Each run covers some rows; `--write-figures` runs all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from math import pi, radians

import numpy as np

from sagittal.core.body.erkf.filter import filter_block
from sagittal.core.body.erkf.params import ErkfParams
from sagittal.core.body.erkf.smoother import smooth
from sagittal.core.body.erkf.start import start_state
from sagittal.core.body.tree import ImuTree
from sagittal.core.frames import Floats
from sagittal.core.rotation import about, conjugate, exp, multiply, rotate
from sagittal.core.simulate import Arc, Pivot, RecordingSetup, SoftTissue, Stand, Straight, Walker, simulate
from tests.core.body.erkf.walks import SEGMENTS, Take, take_of
from tests.helpers.erkf_scoring import HEADER, Score, largest, score
from validation.figures import record
from validation.marks import WHOLE, whole_only

LAP = (
    Straight(12.8, 0.64, 0.54), Arc(1.5, pi, 0.52, 0.56), Straight(10.0, 0.5, 0.6), Pivot(-pi, 0.7, 0.55),
    Arc(1.6, 2 * pi, 0.52, 0.56), Arc(1.6, -2 * pi, 0.52, 0.56), Stand(10.0),
)  # fmt: skip
LONG = (Stand(6.0), *LAP * 4)
SHORT = (Stand(6.0), *LAP, Straight(12.8, 0.64, 0.54), Stand(4.0))
SEEDS = (2, 3, 4)

PLAIN = ErkfParams(
    states=9, acc_sd=0.05, gyr_sd=0.01, gyr_sd_of={}, impact=0.0, joint_axis_sd=0.05
)  # fmt: skip
"""What the ablations start from: white noise alone."""

LIMITS = {"hip": (0.3, 0.4, 0.8), "knee": (0.3, 0.3, 0.5), "ankle": (0.3, 0.3, 0.5)}
"""Flexion, adduction, rotation in degrees (docs/science/erkf.md, "Limits on simulated walks")."""

SPEC = (
    ".11 .13 .36, .13 .14 .24, .08 .10 .15, .39, +.4 / 1.3, 2.5, -11.8",
    ".10 .08 .15, .12 .13 .19, .06 .09 .11, .17, +.9 / 1.1, .4, ",
)

LIVE, OFFLINE, PEOPLE = ErkfParams.live(), ErkfParams.offline(), ErkfParams.people()


@cache
def four_minutes() -> Take:
    """Straight and curved ways, a turn on the spot, figures of eight, standing; four times."""
    return take_of(simulate(LONG, seed=2, setup=RecordingSetup()))


@cache
def minute(seed: int) -> Take:
    return take_of(simulate(SHORT, seed=seed, setup=RecordingSetup()))


@cache
def on_skin() -> Take:
    """Soft tissue of 3° and 10 mm, and a shank that turns by 8° as the knee bends."""
    walker = Walker(tibial_rotation_rad=radians(8.0))
    return take_of(simulate(SHORT, walker, seed=2, setup=RecordingSetup(tissue=SoftTissue())))


def run(
    take: Take,
    params: ErkfParams,
    *,
    smoothed: bool = False,
    tree: ImuTree | None = None,
    turn_deg: float = 0.0,
) -> Score:
    """Score of a run; with every second sensor's first heading turned left, the others right."""
    tree = tree or take.tree
    first = start_state(tree, take.inputs, params, take.rest)
    if turn_deg:
        by_key = [about(2, radians(turn_deg if i % 2 else -turn_deg)) for i in range(len(SEGMENTS))]
        q = multiply(np.array(by_key), first.nominal[:, 6:10])
        first = start_state(tree, take.inputs, params, take.rest, q=q)
    track, _ = (smooth if smoothed else filter_block)(first, take.inputs, tree, params)
    return score(replace(take, tree=tree), track)


def without_hips(tree: ImuTree) -> ImuTree:
    return replace(tree, joints=tuple(j for j in tree.joints if not j.name.startswith("pelvis")))


def misaligned(tree: ImuTree) -> ImuTree:
    """The tree as believed with every mounting 2° wrong about some axis and every joint centre 1 cm."""
    rng = np.random.default_rng(1)

    def any_way() -> Floats:
        v = rng.normal(size=3)
        return np.asarray(v / np.linalg.norm(v))

    q = np.stack([multiply(exp(radians(2.0) * any_way()), m) for m in tree.q_mount])
    joints = []
    for j in tree.joints:
        ends = []
        for i, r in ((j.proximal, j.r_proximal), (j.distal, j.r_distal)):
            ends.append(rotate(conjugate(q[i]), rotate(tree.q_mount[i], r)) + 0.01 * any_way())
        joints.append(replace(j, r_proximal=ends[0], r_distal=ends[1]))
    return replace(tree, q_mount=q, joints=tuple(joints))


ABLATIONS: dict[str, Callable[[Take], Score]] = {
    "all": lambda take: run(take, PLAIN),
    "no joint axis": lambda take: run(take, replace(PLAIN, joint_axis_sd=None)),
    "no tilt": lambda take: run(take, replace(PLAIN, tilt_sd=None)),
    "no zero velocity": lambda take: run(take, replace(PLAIN, zero_velocity_sd=1e4, gate=None)),
    "no joint centre": lambda take: run(take, replace(PLAIN, joint_centre_sd=None)),
    "joint centres without hips": lambda take: run(take, PLAIN, tree=without_hips(take.tree)),
    "Euler": lambda take: run(take, replace(PLAIN, integration="euler")),
    "σ_ω .003": lambda take: run(take, replace(PLAIN, gyr_sd=0.003)),
    "σ_ω .03": lambda take: run(take, replace(PLAIN, gyr_sd=0.03)),
    "σ_JC 3 mm": lambda take: run(take, replace(PLAIN, joint_centre_sd=0.003)),
    "σ_JC 30 mm": lambda take: run(take, replace(PLAIN, joint_centre_sd=0.03)),
    "σ_ω .02": lambda take: run(take, replace(PLAIN, gyr_sd=0.02, joint_axis_sd=0.2)),
    "σ_ω .02, impact rule": lambda take: run(
        take, replace(PLAIN, gyr_sd=0.02, joint_axis_sd=0.2, impact=0.3)
    ),
    "15 states, σ_ω .003": lambda take: run(take, replace(PLAIN, states=15, gyr_sd=0.003, joint_axis_sd=0.2)),
}
EVERY_RUN = ("all", "no zero velocity", "no joint centre", "Euler")


@cache
def ablation(name: str) -> Score:
    return ABLATIONS[name](four_minutes())


def test_what_each_correction_holds_is_written_down() -> None:
    record(
        "ErKF on simulated walks: what each correction holds",
        ["run", *HEADER],
        [[name, *ablation(name).row()] for name in (ABLATIONS if WHOLE else EVERY_RUN)],
        "Filter alone, four minutes of walking, turning and standing, RMS from 12 s on, worse side; known "
        "mounts and places. 9 states, σ_a 0.05 m/s², σ_ω 0.01 rad/s, σ_JA 0.05 rad, no impact rule unless "
        "said. Without joint centres the relative headings drift, without zero velocity the positions do; "
        "tilt changes nothing, the joint axis little where the knee is a hinge; Euler's rule costs flexion "
        "at 100 Hz. The impact rule, which real shoes need, costs heading and gains strides.",
        whole=WHOLE,
    )


def test_the_main_corrections_hold_what_the_paper_gave_them_for() -> None:
    """Direction and size as in docs/science/erkf.md, "Departures from the paper"."""
    whole, drifting, loose, euler = (ablation(name) for name in EVERY_RUN)
    assert drifting.stride > 500.0
    assert abs(drifting.hip - whole.hip).max() < 0.4
    assert loose.heading > 5.0 * whole.heading
    assert loose.width > 1000.0
    assert loose.stride > 3.0 * whole.stride
    assert 2.0 * whole.knee[0] < euler.knee[0] < 1.2
    assert min(euler.hip[0] / whole.hip[0], euler.ankle[0] / whole.ankle[0]) > 1.25
    assert -25.0 < euler.stride_bias - whole.stride_bias < -5.0


@whole_only
def test_every_correction_holds_what_the_paper_gave_it_for() -> None:
    """The same of the others."""
    whole = ablation("all")
    assert_close(ablation("no tilt"), whole, 0.05)
    assert abs(ablation("no joint axis").heading - whole.heading) < 0.2
    assert 1.5 * whole.knee[2] < ablation("no joint axis").knee[2] < 0.5
    hipless = ablation("joint centres without hips")
    assert hipless.hip[2] > 5.0 * whole.hip[2]
    assert hipless.width > 1000.0
    assert abs(hipless.knee - whole.knee).max() < 0.1
    assert ablation("σ_ω .003").hip[2] > 1.5 * whole.hip[2] > 1.8 * ablation("σ_ω .03").hip[2]
    assert ablation("σ_JC 3 mm").hip[2] < whole.hip[2] < ablation("σ_JC 30 mm").hip[2]
    assert ablation("15 states, σ_ω .003").hip[2] < 0.75 * whole.hip[2]
    assert ablation("15 states, σ_ω .003").heading < 0.6 * whole.heading
    assert ablation("σ_ω .02").hip[2] < 1.4
    assert ablation("σ_ω .02, impact rule").stride < 0.5 * ablation("σ_ω .02").stride


BARE = replace(OFFLINE, gyr_sd_of={})
SETS: dict[str, Callable[[], Score]] = {
    "live, seeds 2, 3, 4": lambda: largest([run(minute(seed), LIVE) for seed in SEEDS]),
    "offline, filter, seeds 2, 3, 4": lambda: largest([run(minute(seed), BARE) for seed in SEEDS]),
    "offline, smoothed, seeds 2, 3, 4": lambda: largest(
        [run(minute(seed), BARE, smoothed=True) for seed in SEEDS]
    ),
    "live, 4 min": lambda: run(four_minutes(), LIVE),
    "offline, filter, 4 min": lambda: run(four_minutes(), BARE),
    "offline, smoothed, 4 min": lambda: run(four_minutes(), BARE, smoothed=True),
}


def test_live_offline_and_smoothed_keep_the_limits_of_the_specification() -> None:
    """docs/science/erkf.md, "Limits on simulated walks". The filter alone may have 0.3° of rotation more: the
    impact rule lets less be learned of heading, which the smoother makes up for."""
    by_name = {name: make() for name, make in SETS.items() if WHOLE or "seeds" in name}
    record(
        "ErKF on simulated walks: parameter sets",
        ["run", *HEADER],
        [
            *([name, *s.row()] for name, s in by_name.items()),
            ["prototype, another walker, filter, 310 s", *SPEC[0].split(", "), ""],
            ["the same smoothed", *SPEC[1].split(", "), ""],
        ],
        "The shipped sets, the offline one without its allowance for soft tissue at the thighs, which these "
        "sensors do not need. Largest of three walks of about 80 s, and one of four minutes. The "
        "prototype's figures are of another walker, of true first positions, and without the impact rule.",
        whole=WHOLE,
    )
    for name, s in by_name.items():
        if name.startswith("live"):
            assert s.stride < 6.0, name
            assert s.hip[2] < (2.5 if "seeds" in name else 3.0), name
            assert s.hip[0] < 0.5, name
            assert s.knee[0] < 0.5, name
            assert s.ankle[0] < 0.5, name
            continue
        for joint, limits in LIMITS.items():
            found_here = getattr(s, joint)
            assert (found_here[:2] < limits[:2]).all(), (name, joint)
            assert found_here[2] < limits[2] + (0.3 if "filter" in name else 0.0), (name, joint)
        assert abs(s.stride_bias) < 5.0, name
        assert s.stride < 6.0, name
        assert s.width < 9.0, name
    for walks in ("seeds 2, 3, 4", "4 min") if WHOLE else ("seeds 2, 3, 4",):
        single, pair = (by_name[f"offline, {x}, {walks}"] for x in ("filter", "smoothed"))
        assert pair.stride < single.stride
        assert pair.ankle[2] < single.ankle[2]
    if WHOLE:
        assert pair.heading < 0.8 * single.heading


def test_calibration_is_the_accuracy_budget_not_the_filter() -> None:
    """2° of misalignment and 1 cm of joint-centre error cost ten times the filter's error. The hinge axis
    harms where the knee is not a hinge.
    """
    take, skin = minute(2), on_skin()
    wrong = misaligned(skin.tree)
    result = {
        "known mounts, on bone": run(take, OFFLINE, smoothed=True),
        "on skin, knee turns by 8°": run(skin, OFFLINE, smoothed=True),
        "the same, σ_JA 0.05 rad": run(skin, replace(OFFLINE, joint_axis_sd=0.05), smoothed=True),
        "the same, mounts 2° and joint centres 1 cm wrong": run(skin, PEOPLE, smoothed=True, tree=wrong),
    }
    record(
        "ErKF on simulated walks: sensors on skin",
        ["run", *HEADER],
        [[name, *s.row()] for name, s in result.items()],
        "Offline set, smoothed; 80 s. Soft tissue 3° and 10 mm. The hinge's axis as a measurement is off in "
        "the shipped sets, because knees turn. Joint centres 30 mm where they are wrong (`people`).",
    )
    bone, tissue, hinged, wrongly = result.values()
    assert tissue.hip[0] < 1.5
    assert tissue.knee[0] < 1.0
    assert hinged.hip[2] > 2.0 * tissue.hip[2]
    assert hinged.heading > 1.5 * tissue.heading
    assert max(wrongly.hip.max(), wrongly.knee.max(), wrongly.ankle.max()) > 5.0 * bone.hip.max()
    assert max(wrongly.hip.max(), wrongly.knee.max(), wrongly.ankle.max()) < 6.0


def assert_close(a: Score, b: Score, deg: float) -> None:
    for joint in ("hip", "knee", "ankle"):
        assert np.abs(getattr(a, joint) - getattr(b, joint)).max() < deg, joint
    assert abs(a.stride - b.stride) < 1.0
