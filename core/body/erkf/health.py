"""Health of an ErKF run (docs/reference/estimators.md, "Health")."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from sagittal.core.body.erkf.poses import ErkfRun
from sagittal.core.body.erkf.start import find_parts
from sagittal.core.body.health import LONGEST_MOVING_S, HealthFinding, longest_run_s
from sagittal.core.errors import Notice, Severity
from sagittal.core.message import Message
from sagittal.core.rotation import conjugate, multiply, wrap_angle, yaw
from sagittal.core.signals.held_samples import cut_blocks

RESIDUAL_MM: Final = (25.0, 80.0)
"""RMS distance of the two ends of a joint while moving. A right set-up has 3 to 19 (simulation, neura_walk),
a thigh 100 ms late or exchanged legs 30, exchanged sensors 57 to 186
(docs/science/real-recordings.md, "Wrong handling")."""

REFUSED_PCT: Final = (2.0, 20.0)
"""Zero velocities refused, of all; a real shoe stays below (docs/science/real-recordings.md, "Limits"). Half
a second lost unnoticed gives 26; a real take with a fifth of its packets lost 42, and strides of 1.4 m are
0.5 m there."""

GAP_S: Final = 0.5
"""Loss of a sensor in one piece; 0.3 s cost a degree and pass (docs/science/erkf.md, "Lost samples")."""

CLIMB_PCT: Final = 3.0
"""The floor's height at the end against the start, of the way walked: level walks have up to 1.4 (simulation,
neura_walk, gaitmap), a ramp for wheelchairs 5."""

CLIMB_WAY_M: Final = 5.0
"""A shorter way than this is taken as this long: a level take of 10 s may end 0.1 m up."""

START_HEADING_DEG: Final = (30.0, 90.0)
"""A first heading off the others'. 30° is the start's own deviation; up to 90° the joints bring it back,
beyond up to 16° stay for a take (simulation, one sensor the wrong way round)."""


def erkf_health(run: ErkfRun) -> tuple[HealthFinding, ...]:
    """Judge a run by its own diagnostics: joints, zero velocities, data loss, height, covariance."""
    rate = 1.0 / float(np.median(run.inputs.step_s[run.inputs.step_s > 0.0]))
    valid, findings = run.inputs.valid, []
    moving = ~run.inputs.still.all(axis=1)
    for k, joint in enumerate(run.tree.joints):
        both_valid = valid[:, joint.proximal] & valid[:, joint.distal] & moving
        residual = run.track.joint_residual[both_valid, k]
        value = 1e3 * float(np.sqrt(np.mean(residual**2))) if len(residual) else float("nan")
        findings.append(HealthFinding("joint_residual_mm", joint.name, value, *RESIDUAL_MM))
    for i in run.tree.feet:
        name, contact = run.tree.imus[i], run.inputs.contact[:, i]
        refused = 100.0 * run.track.refused[contact, i].mean() if contact.any() else 0.0
        findings.append(HealthFinding("zero_velocity_refused_pct", name, float(refused), *REFUSED_PCT))
        findings.append(HealthFinding("contact_pct", name, 100.0 * float(contact.mean())))
        findings.append(
            HealthFinding("longest_moving_s", name, longest_run_s(~contact, rate), *LONGEST_MOVING_S)
        )
        if contact.any():
            findings.append(HealthFinding("climb_pct", name, _climb_pct(run, i), warn=CLIMB_PCT))
    for i, name in enumerate(run.tree.imus):
        lost = longest_run_s(~valid[:, i], rate)
        if lost > 0.0:
            findings.append(HealthFinding("gap_s", name, lost, warn=GAP_S))
    if run.tree.joints:
        findings.append(_start_heading(run))
    findings.append(HealthFinding("heading_sd_deg", None, float(np.degrees(run.track.heading_sd[-1].max()))))
    findings.append(HealthFinding("min_eigenvalue", None, float(np.linalg.eigvalsh(run.final.P)[0])))
    return tuple(findings)


TOLD: Final[Mapping[str, tuple[str, Severity, str]]] = {
    "joint_residual_mm": (
        "sensors_do_not_hang_together",
        "warning",
        (
            "The two sensors at {of} are inconsistent: their joint centres are {value:.0f} mm apart on "
            "average, expected up to {warn:.0f} mm. Check left and right, sensor assignment and "
            "alignment, body height, and clock synchronisation."
        ),
    ),
    "zero_velocity_refused_pct": (
        "zero_velocity_refused",
        "warning",
        (
            "{value:.0f} % of the foot-flat periods of {of} do not fit its path (expected up to "
            "{warn:.0f} %), so distances of this foot are unreliable. Possible causes: a loose sensor, a "
            "slipping shoe or undetected sample loss."
        ),
    ),
    "longest_moving_s": (
        "foot_never_still",
        "warning",
        (
            "{of} is not flat on the floor for {value:.0f} s (expected at most {warn:.0f} s), so its "
            "path drifts. Possible causes: toe walking, a treadmill or a sensor on another segment."
        ),
    ),
    "climb_pct": (
        "not_level",
        "warning",
        (
            "The floor under {of} rises or falls by {value:.0f} % of the distance walked (expected up to "
            "{warn:.0f} % on level ground): stairs, a slope, a sensor on the wrong foot or sensor drift."
        ),
    ),
    "start_heading_off_deg": (
        "start_heading_off",
        "warning",
        (
            "Joint motion shows that {of} started {value:.0f}° off its assumed heading (expected up to "
            "{warn:.0f}°): a sensor attached the wrong way round or on another segment, or a wrong "
            "calibration. Rotation and frontal angles are unreliable."
        ),
    ),
    "gap_s": (
        "gap_bridged",
        "info",
        "{of} was lost for {value:.1f} s without a break; its pose is bridged by adjacent segments.",
    ),
}
"""Finding → code, severity and words of the notice when it is not good."""

STARTED_MOVING: Final = (
    "The trial starts without quiet standing: the estimator started mid-walk and needs a few strides to "
    "settle. Stand still for 3 to 5 s first where possible."
)


def erkf_notices(run: ErkfRun, findings: tuple[HealthFinding, ...]) -> tuple[Notice, ...]:
    """Notices for the user on the health of the run."""
    notices = []
    for f in findings:
        if f.verdict != "good" and f.name in TOLD:
            code, severity, words = TOLD[f.name]
            message = Message(words, of=f.of, value=f.value, warn=f.warn)
            notices.append(
                Notice(code, message, sensor=(f.of or "").split("-")[-1] or None, severity=severity)
            )
    if run.rest is None:
        notices.append(Notice("started_moving", STARTED_MOVING, t_s=0.0))
    return tuple(notices)


def _start_heading(run: ErkfRun) -> HealthFinding:
    """Largest correction of a sensor's initial heading by the smoother, relative to the median of its
    part.
    """
    turn = yaw(multiply(np.stack([q[0] for q in run.track.turns]), conjugate(run.start.nominal[:, 6:10])))
    part = find_parts(run.tree)
    off = np.zeros(len(turn))
    for root in set(part.tolist()):
        apart = wrap_angle(turn[part == root] - turn[root])
        off[part == root] = wrap_angle(apart - np.median(apart))
    most = int(np.argmax(np.abs(off)))
    value = float(np.degrees(abs(off[most])))
    return HealthFinding("start_heading_off_deg", run.tree.imus[most], value, *START_HEADING_DEG)


def _climb_pct(run: ErkfRun, foot: int) -> float:
    """Height difference between the first and the last rest of a foot, relative to the distance travelled,
    %.
    """
    rests = run.inputs.contact[:, foot]
    place, turned = run.track.places[foot], run.track.turns[foot]
    path = np.concatenate(
        [
            run.tree.segment(foot, place[part][rests[part]], turned[part][rests[part]])[1]
            for part in cut_blocks(len(rests))
        ]
    )
    way = float(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1).sum())
    return 100.0 * float(abs(path[-1, 2] - path[0, 2])) / max(way, CLIMB_WAY_M)
