"""Parts of stance, pitch and path of the feet on gaitmap_foot against shoe markers.

Markers: FCC heel, TOE tip, FM5 fifth metatarsal head. Marker pitch is that of the heel–tip line less its mean
in quiet stance. The 3° limit is 1 cm over a foot, not fitted. The sensor position on the shoe, 5 cm in front
of the heel marker, was estimated from the heel's path here, so clearance shows spread and minimum, not the
accuracy of a tape.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from sagittal.core.body import nominal_body
from sagittal.core.events.result import Stride
from sagittal.core.frames import FOOT, SIDES, Floats, Side
from sagittal.core.parameters.measure import MeasuredGait, Tracks, measure_gait
from sagittal.core.parameters.stance import FLAT_RAD, NAMES, find_stances
from sagittal.core.subject.shoe import Shoe
from tests.helpers.gaitmap import MARKERS, MOCAP_RATE, analysed, table
from validation.figures import record, record_in_short


@cache
def gait() -> tuple[Tracks, MeasuredGait]:
    done = analysed()
    assert done.tracks is not None
    assert done.measured is not None
    return done.tracks, done.measured


@cache
def markers(side: Side) -> dict[str, Floats]:
    """Marker → (n, 3) m."""
    header, numbers = table("mocap_sample.csv")
    return {
        m: numbers[:, [header.index(f"{side[0].upper()}_{m}/{a}") for a in "xyz"]] / 1000 for m in MARKERS
    }


@cache
def marker_pitch(side: Side) -> tuple[Floats, Floats]:
    """Times and pitch (n,) in rad of the line from heel to tip, toes up."""
    foot = markers(side)
    line = foot["TOE"] - foot["FCC"]
    t = np.arange(len(line)) / MOCAP_RATE
    pitch = np.arctan2(line[:, 2], np.hypot(line[:, 0], line[:, 1]))
    own = gait()[1].strides.select_used(side)
    quiet = np.concatenate(
        [pitch[(t > s.start_s + 0.3 * stance(s)) & (t < s.start_s + 0.5 * stance(s))] for s in own]
    )
    return t, pitch - quiet.mean()


def stance(s: Stride) -> float:
    assert s.tc_s is not None
    return s.tc_s - s.start_s


def counted(side: Side, name: str) -> Floats:
    _, measured = gait()
    column = measured.columns[name]
    return np.array([
        column[i]
        for i, s in enumerate(measured.strides.strides)
        if s.side == side and s.excluded_reason is None
    ], np.float64)  # fmt: skip


def spread(errors: Floats, form: str) -> str:
    return f"{errors.mean():+{form}} ± {errors.std():{form}}"


def strides(side: Side) -> list[Stride]:
    return list(gait()[1].strides.select_used(side))


def test_parts_of_stance_are_those_of_the_markers() -> None:
    """Ours against the same rule on the pitch of the markers, and against heel and tip 1 cm off the floor."""
    rows = []
    _, measured = gait()
    for side in SIDES:
        t, pitch = marker_pitch(side)
        own = find_stances(measured.strides, t, {FOOT[side]: pitch})
        used = measured.strides.columns.used[side]
        same = np.stack([own.parts[n].values[used] for n in NAMES], axis=1)
        ours = np.stack([counted(side, n) for n in NAMES], axis=1)
        lifted = np.array([lift_pct(side, t, s) for s in strides(side)])
        error = ours - same
        rows += [
            [side, label, f"{len(ours)}", f"{ours[:, i].mean():.1f}", spread(error[:, i], ".1f"),
             spread(ours[:, i] - lifted[:, k], ".1f")]
            for label, i, k in (("loading_pct", 0, 0), ("push_pct", 2, 1))
        ]  # fmt: skip
        assert np.abs(error.mean(axis=0)).max() < 1.5
        assert error.std(axis=0).max() < 2.0
        assert np.abs((ours[:, [0, 2]] - lifted).mean(axis=0)).max() < 3.0
    record(
        "Parts of stance on gaitmap_foot",
        ["foot", "part", "strides", "% of stance", "− same rule on markers", "− marker 1 cm off the floor"],
        rows,
        "Found − motion capture, counted strides, between the same contacts; markers: heel for push, tip for "
        "loading. Limits: mean 1.5 and SD 2 % of stance against the same rule, 3 % against the height.",
    )


def lift_pct(side: Side, t: Floats, s: Stride) -> tuple[float, float]:
    """Loading and push in % of stance by the heights of tip and heel, 1 cm over their level in mid-stance."""
    foot, length = markers(side), stance(s)
    part = (t >= s.start_s) & (t <= s.start_s + length)
    share = (t[part] - s.start_s) / length
    middle = (share > 0.3) & (share < 0.5)
    tip, heel = (foot[m][part, 2] - np.median(foot[m][part, 2][middle]) for m in ("TOE", "FCC"))
    down = share[(tip > 0.01) & (share < 0.4)].max(initial=0.0)
    up = share[(heel > 0.01) & (share > 0.4)].min(initial=1.0)
    return 100.0 * float(down), 100.0 * float(1.0 - up)


def test_pitch_at_contact_and_foot_off_is_that_of_the_markers() -> None:
    rows, at_contact = [], []
    for side in SIDES:
        t, pitch = marker_pitch(side)
        for name, times in (
            ("foot_pitch_ic_deg", [s.start_s for s in strides(side)]),
            ("foot_pitch_tc_deg", [s.tc_s or np.nan for s in strides(side)]),
        ):
            ours = counted(side, name)
            error = ours - np.degrees(np.interp(times, t, pitch))
            rows.append([side, name, str(len(ours)), f"{ours.mean():.1f}", spread(error, ".1f")])
            assert abs(error.mean()) < 3.0
            assert error.std() < 2.0
            if name == "foot_pitch_ic_deg":
                at_contact.append(f"{side} {spread(error, '.1f')}")
    record_in_short(
        "Foot pitch at contact °",
        "–",
        ", ".join(at_contact),
        "gaitmap_foot, 1 person, against the markers of the shoe",
    )
    record(
        "Pitch of the foot on gaitmap_foot",
        ["foot", "parameter", "strides", "degrees", "− markers"],
        rows,
        "Found − line from heel to tip marker at the same moments, zero in mid-stance. Limits: mean 3°, "
        "SD 2°.",
    )


def test_the_limit_of_the_flat_is_a_centimetre_between_these_markers() -> None:
    for side in SIDES:
        foot = markers(side)
        line = np.linalg.norm((foot["TOE"] - foot["FCC"])[:, :2], axis=1)
        assert 0.007 < np.median(line) * np.sin(FLAT_RAD) < 0.015


SHOE = Shoe(0.05, 0.20, 0.0)
"""Heel and tip marker seen from the sensor; see above for how this was found."""


def test_heel_and_toe_pass_the_floor_as_their_markers_do() -> None:
    tracks, measured = gait()
    assert tracks.feet is not None
    body, _ = nominal_body(None, None, SHOE)
    second_gait = measure_gait(replace(tracks, feet=replace(tracks.feet, body=body)))
    rows = []
    for side in SIDES:
        foot = markers(side)
        t = np.arange(len(foot["TOE"])) / MOCAP_RATE
        own = [i for i, s in enumerate(measured.strides.strides) if s in strides(side)]
        heights = np.array([clearance(foot, t, s) for s in strides(side)])
        for name, true in zip(("max_heel_clearance_m", "min_toe_clearance_m"), heights.T, strict=True):
            column = second_gait.columns[name]
            ours = 1000 * np.array([column[i] for i in own], np.float64)
            pair = np.isfinite(ours) & np.isfinite(true)
            error = (ours - 1000 * true)[pair]
            rows.append(
                [side, name, f"{pair.sum()}/{len(own)}", f"{ours[pair].mean():.0f}", spread(error, ".0f")]
            )
            assert pair.sum() >= 0.8 * len(own)
            assert abs(error.mean()) < (15.0 if "heel" in name else 10.0)
            assert error.std() < 12.0
    record(
        "Clearance on gaitmap_foot",
        ["foot", "parameter", "strides", "mm", "− marker"],
        rows,
        "Found − rise of the heel marker over its level in mid-stance, and of the tip marker in the dip of "
        "mid-swing; the sole begins 5 cm behind the sensor and ends 20 cm before it, which was found from "
        "the heel's path here. Limits: mean 15 mm (heel) and 10 mm (toe), SD 12 mm.",
    )


def clearance(foot: dict[str, Floats], t: Floats, s: Stride) -> tuple[float, float]:
    """Most height of the heel and the tip's dip in swing, m over their level in mid-stance; NaN without."""
    assert s.tc_s is not None
    quiet = (t > s.start_s + 0.3 * stance(s)) & (t < s.start_s + 0.5 * stance(s))
    heel, tip = (foot[m][:, 2] - foot[m][quiet, 2].mean() for m in ("FCC", "TOE"))
    swing = tip[(t >= s.tc_s) & (t <= s.end_s)]
    depth = np.minimum(np.maximum.accumulate(swing), np.maximum.accumulate(swing[::-1])[::-1]) - swing
    low = int(np.argmax(depth))
    most = float(heel[(t > s.start_s + 0.5 * stance(s)) & (t < s.end_s)].max())
    return most, float(swing[low]) if depth[low] > 0.001 else float("nan")


def heading(foot: dict[str, Floats]) -> Floats:
    """Direction (n,) of the line from heel to tip along the floor, rad."""
    line = foot["TOE"] - foot["FCC"]
    return np.unwrap(np.arctan2(line[:, 1], line[:, 0]))


def test_direction_and_path_of_the_foot_are_those_of_the_markers() -> None:
    rows = []
    for side in SIDES:
        foot, mirror = markers(side), 1.0 if side == "left" else -1.0
        t, way = np.arange(len(foot["TOE"])) / MOCAP_RATE, heading(foot)
        out, swung, turned = [], [], []
        for s in strides(side):
            a, b = s.start_s + 0.4 * stance(s), s.end_s + 0.4 * stance(s)
            from_, to = (np.array([np.interp(x, t, c) for c in foot["FCC"].T])[:2] for x in (a, b))
            along = (to - from_) / np.linalg.norm(to - from_)
            angle = np.interp(a, t, way) - np.arctan2(along[1], along[0])
            out.append(mirror * np.degrees(np.remainder(angle + np.pi, 2 * np.pi) - np.pi))
            path = foot["FCC"][(t >= a) & (t <= b), :2] - from_
            swung.append((path @ (mirror * np.array([-along[1], along[0]]))).max())
            turned.append(np.degrees(np.diff(np.interp((s.start_s, s.end_s), t, way))[0]))
        toe_out, lateral = counted(side, "toe_out_deg"), 1000 * counted(side, "circumduction_m")
        turn = counted(side, "turning_angle_deg") - np.array(turned)
        rows += [
            [side, "toe_out_deg", f"{toe_out.mean():.1f}", f"{np.mean(out):.1f}",
             spread(toe_out - out, ".1f")],
            [side, "turning_angle_deg", f"{np.mean(turned) + turn.mean():.1f}", f"{np.mean(turned):.1f}",
             spread(turn, ".1f")],
            [side, "circumduction_m, mm", f"{lateral.mean():.0f}", f"{1000 * np.mean(swung):.0f}",
             spread(lateral - 1000 * np.array(swung), ".0f")],
        ]  # fmt: skip
        # from standing: the level is another, its change from stride to stride is the same
        assert (toe_out - out).std() < 2.5
        assert np.corrcoef(toe_out, out)[0, 1] > 0.6
        assert abs(turn.mean()) < 1.0
        assert turn.std() < 2.5
        assert abs(lateral.mean() - 1000 * np.mean(swung)) < 15.0
        assert (lateral - 1000 * np.array(swung)).std() < 12.0
    record(
        "Direction and path of the feet on gaitmap_foot",
        ["foot", "parameter", "found", "markers", "found − markers"],
        rows,
        "Counted strides; line from heel to tip marker, path of the heel marker. Toe-out is told from "
        "standing, so its level is another than the markers'. Limits: toe-out SD 2.5° and r > 0.6, turning "
        "mean 1° and SD 2.5°, circumduction mean 15 mm and SD 12 mm.",
    )
