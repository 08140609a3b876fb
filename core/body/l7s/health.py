"""Health of an L7S run (docs/reference/estimators.md, "Health")."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi
from typing import Any, Final, cast

import numpy as np

from sagittal.core.body.health import LONGEST_MOVING_S, HealthFinding, longest_run_s
from sagittal.core.body.poses import Poses
from sagittal.core.errors import Notice
from sagittal.core.frames import Protocol, Segment
from sagittal.core.message import Message

CONSTRAINT_MM: Final = (1.0, 10.0)
"""What constraints leave after projection: below .01 with two, 10 accepted with one
(docs/science/l7s.md, "Limits on simulated walks")."""

OUT_OF_PLACE_PCT: Final = (20.0, 50.0)
"""Of the time in motion. Right walks have 0, with a turn on the spot 10 (neura_walk); feet whose headings are
20° apart 58 to 97."""

PHASE_PCT: Final = (12.0, 25.0)
"""Right walks have up to 3, those of one-sided patients too; a foot 0.2 s late 18, one sensor taken for both
feet 50."""

TOWARD_MPS2: Final = (-0.05, 0.1)
"""Right walks have −1.0 to −0.28, with the feet exchanged the same with the other sign."""

INNER_M: Final = (0.15, 0.15)
"""Feet alone: right walks have −0.32 to 0.08 (ipol_walks, gaitmap_foot, neura_walk, simulation), those with
exchanged feet −0.55 to 0.35. Above this they are exchanged; up to it nothing is known and nothing told."""

TILT_DEG: Final = (7.0, 12.0)
"""Right walks have 0.2 to 3.4, a thigh 12 and more."""

RISE_CM: Final = (10.0, 20.0)
"""Walks have 1 to 8 (within 5 mm of the truth in simulation), squats and chairs 12 to 25."""

STRAIGHT_PCT: Final = (30.0, 50.0)
"""Of the time in motion with the knee at its bound. Right walks have 1 to 20 (simulated people with and
without disease, neura_walk, qmt_fullbody, ipol_walks); healthy knees are within 3° of straight for a tenth of
the cycle, and one that rests there for most of the time was not estimated at all."""

MOVED_MM: Final = (1.0, 10.0)
"""In the last pass of Gauss–Newton, which ends below 0.1 or after 20 passes. A walk whose foot was lost for
half of it still moves by millimetres then, and noise of 1e-12 m/s² changes its places by as much."""

FOOT_GAP_S: Final = (0.1, 0.3)
"""Holes up to 0.1 s are interpolated. With one sensor a leg nothing knows where the foot went: in one of
0.5 s flexion is up to 65° off, and within 10 s of its end 3 to 17° (simulation; live 50 to 90°)."""

PELVIS_GAP_S: Final = (0.5, None)
"""Up to 1 s of the pelvis cost 1 to 3° in the second after it."""

LEVEL: Final[tuple[Protocol, ...]] = ("squat", "activity", "tug")
"""Protocols in which the pelvis does not keep its height, as L7S takes it to."""


def l7s_health(poses: Poses) -> tuple[HealthFinding, ...]:
    """Judge a run of `l7s_poses` by its own diagnostics."""
    d = cast("dict[str, Any]", poses.diagnostics)
    findings = []
    for side in d["hinge_m"]:
        foot: Segment = "foot_l" if side == "left" else "foot_r"
        leg = f"leg_{side[0]}"
        moving = longest_run_s(~np.asarray(poses.contact[foot]), poses.rate_hz)
        findings += [
            HealthFinding("longest_moving_s", foot, moving, *LONGEST_MOVING_S),
            HealthFinding("leg_excess_mm", leg, 1e3 * d["excess_m"][side], *CONSTRAINT_MM),
            HealthFinding("hinge_mm", leg, 1e3 * d["hinge_m"][side], *CONSTRAINT_MM),
            # the leg's length is only bounded from above: at the bound the knee is straight, whatever it did
            HealthFinding("knee_straight_pct", leg, 100.0 * d["knee_straight_share"][side], *STRAIGHT_PCT),
            HealthFinding("foot_turned_deg", foot, float(np.degrees(d["foot_turned_rad"][side]))),
        ]
    for segment, lost_s in d["gap_s"].items():
        if lost_s > 0.0:
            findings.append(
                HealthFinding(
                    "gap_s", segment, lost_s, *(PELVIS_GAP_S if segment == "pelvis" else FOOT_GAP_S)
                )
            )
    for key, name, scale, limits in JUDGED:
        if key in d:
            findings.append(HealthFinding(name, None, scale * d[key], *limits))
    if not {"toward_foot_mps2", "inner_foot_m"} & {f.name for f in findings}:
        findings.append(HealthFinding("inner_foot_m", None, float("nan")))
    findings.append(HealthFinding("min_eigenvalue", None, float(d["min_eigenvalue"])))
    return tuple(findings)


JUDGED: Final = (
    ("moved_m", "places_moved_mm", 1e3, MOVED_MM),
    ("out_of_place_share", "feet_out_of_place_pct", 100.0, OUT_OF_PLACE_PCT),
    ("phase_off", "phase_off_pct", 100.0, PHASE_PCT),
    ("toward_foot_mps2", "toward_foot_mps2", 1.0, TOWARD_MPS2),
    ("inner_foot_m", "inner_foot_m", 1.0, INNER_M),
    ("pelvis_tilt_sd_rad", "pelvis_tilt_sd_deg", 180.0 / pi, TILT_DEG),
    ("pelvis_rise_m", "pelvis_rise_cm", 100.0, RISE_CM),
)
"""Diagnostic of the run, or quantity of `walking_checks`, name of its finding, scale to its unit, limits."""

TOLD: Final[Mapping[str, tuple[str, str]]] = {
    "feet_out_of_place_pct": (
        "feet_drift_apart",
        (
            "For {value:.0f} % of the time (expected up to {warn:.0f} %) the feet are not side by side "
            "under the hips: the sensors disagree on the forward direction. Angles and positions are "
            "wrong there; calibrate again and check sensor alignment."
        ),
    ),
    "phase_off_pct": (
        "feet_out_of_step",
        (
            "The feet do not alternate: one foot-flat is {value:.0f} % of a stride away from the middle "
            "of the other foot's (expected up to {warn:.0f} %). Check clock synchronisation and that no "
            "sensor was used twice."
        ),
    ),
    "toward_foot_mps2": (
        "feet_exchanged",
        (
            "The pelvis accelerates towards the stance foot ({value:+.2f} m/s²; below {warn:g} in normal "
            "walking): the left and right foot sensors appear swapped, or the pelvis sensor faces "
            "backwards."
        ),
    ),
    "inner_foot_m": (
        "feet_exchanged",
        (
            "In turns the inner foot travels further than the outer one ({value:+.2f} m per radian, "
            "expected below {warn:g}): the left and right foot sensors appear swapped."
        ),
    ),
    "pelvis_tilt_sd_deg": (
        "not_a_pelvis",
        (
            "The pelvis sensor tilts by {value:.0f}° (standard deviation; expected up to {warn:.0f}° in "
            "walking): it is on another segment, or the walk was not on level ground."
        ),
    ),
    "pelvis_rise_cm": (
        "pelvis_rises",
        (
            "The pelvis rises and falls by {value:.0f} cm within seconds (expected up to {warn:.0f} cm "
            "in walking). L7S assumes a constant height: in squats, on stairs and when sitting its "
            "angles are too small. Use seven sensors for those."
        ),
    ),
    "gap_s": (
        "gap_not_bridged",
        (
            "{of} was lost for {value:.1f} s without a break. L7S has no second sensor on the leg to "
            "bridge it; angles and positions are unreliable for about ten seconds afterwards."
        ),
    ),
    "places_moved_mm": (
        "places_not_found",
        (
            "The positions of pelvis and feet did not converge: they still changed by {value:.0f} mm "
            "(expected up to {warn:.0f} mm). The sensors contradict each other or were lost for long "
            "periods. Angles and positions are unreliable; check data loss and which foot each sensor is "
            "on."
        ),
    ),
    "hinge_mm": (
        "legs_do_not_fit",
        (
            "The leg model does not fit the sensors: {of} is {value:.0f} mm off its hinge (expected up "
            "to {warn:.0f} mm). Check sides, alignment, and undetected data loss."
        ),
    ),
}
"""Finding → code and words of the notice when it is not good."""


def list_health_notices(findings: Sequence[HealthFinding]) -> tuple[Notice, ...]:
    """Notices for the user on the health of the run; only the worst of each kind."""
    notices = {}
    for f in sorted((f for f in findings if f.verdict != "good"), key=lambda f: f.value):
        if f.name in TOLD:
            code, words = TOLD[f.name]
            sensor = f.of if f.name == "gap_s" else None
            message = Message(words, of=f.of, value=f.value, warn=f.warn)
            notices[code] = Notice(code, message, sensor=sensor)
    return tuple(notices.values())


def l7s_notices(protocol: Protocol) -> tuple[Notice, ...]:
    """Notice for recordings of protocols that L7S is not designed for."""
    if protocol not in LEVEL:
        return ()
    message = Message(
        "L7S assumes that the pelvis stays at standing height, which does not hold in '{protocol}'. Use "
        "its angles and positions for walking only, or use seven sensors.",
        protocol=protocol,
    )
    return (Notice("pelvis_height_assumed", message),)
