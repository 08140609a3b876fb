"""Calibration quality: checks of every sensor, each with its limit, interpretation and remedy.

The rules are in one table (score_rules.py); limits are `ScoreParams`. Sources of the limits:
docs/science/calibration.md, "Score".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import degrees
from typing import Any, Final, Literal

import numpy as np

from sagittal.core.agreement import Agreement
from sagittal.core.calibration.forward import MeasureName
from sagittal.core.calibration.functional import FUNCTIONAL
from sagittal.core.calibration.gyro_pca import GOOD_AXIS, measure_main_axis
from sagittal.core.calibration.knee_axis import KNEE_SEEN, STEEPEST, measure_knees
from sagittal.core.calibration.score_rules import RULE_OF, CheckName, CheckRule
from sagittal.core.calibration.walking import TRUNK
from sagittal.core.frames import FOOT, GRAVITY, SEGMENTS, SHANK, SIDES, THIGH, Bools, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.rotation import wrap_angle
from sagittal.core.signals.calibrated import CalibratedRecording
from sagittal.core.signals.rest import index_window, measure_turn

CalibrationVerdict = Literal["pass", "redo", "not_judged"]

TURNED_ALL: Final = 1.0
"""Seconds of straight walking below which no axis is looked for."""

HEARD: Final = 0.2
"""Share from which a measure of forward counts: below, it is wrong altogether and was not followed."""

OF_FORWARD: Final[tuple[MeasureName, ...]] = (
    "velocity", "start_velocity", "acceleration", "proximal_joint", "distal_joint",
)  # fmt: skip
"""Measures of the way forward itself; an axis of turning lies where anatomy has it."""


@dataclass(frozen=True)
class ScoreParams:
    """Limits of the checks (docs/science/calibration.md, "Score").

    Parameters
    ----------
    stillness : rotation of the vertical while standing, degrees. gravity : deviation of |f| at rest from
    gravity, percent.
    axis_share : share of the first component of the rate. repetitions : straight steps; for swings and bows
    those required by `FunctionalParams`. mirror, knee_axis, heading_spread : degrees.
    joint_misfit : difference of the joint acceleration seen from its two sides, relative to its magnitude.
    """

    stillness: float = 4.0
    gravity: float = 10.0
    axis_share: float = 0.70
    repetitions: int = 8
    mirror: float = 25.0
    knee_axis: float = 10.0
    joint_misfit: float = 0.9
    heading_spread: float = 25.0


@dataclass(frozen=True)
class CalibrationCheck:
    """One check of one sensor, or of the whole recording.

    Parameters
    ----------
    segment : None = the whole recording. value : in the unit of its rule, None if it could not be measured.
    limit : None if there is none. why : interpretation of the verdict; empty if passed.
    """

    name: CheckName
    segment: Segment | None
    value: float | None
    limit: float | None
    verdict: CalibrationVerdict
    why: str = ""

    @property
    def rule(self) -> CheckRule:
        """Rule of this check, with its texts."""
        return RULE_OF[self.name]

    @property
    def todo(self) -> str:
        """Remedy; empty unless something has to be repeated."""
        return self.rule.todo if self.verdict == "redo" else ""

    def to_json(self) -> dict[str, object]:
        """The check with its texts, as JSON values."""
        rule = self.rule
        return {
            "name": self.name,
            "title": rule.title,
            "segment": self.segment,
            "value": self.value,
            "unit": rule.unit,
            "limit": self.limit,
            "limit_is": "least" if rule.least else "most",
            "verdict": self.verdict,
            "why": self.why,
            "todo": self.todo,
        }


@dataclass(frozen=True)
class CalibrationScore:
    """All checks of a calibration."""

    checks: tuple[CalibrationCheck, ...]

    @property
    def verdict(self) -> CalibrationVerdict:
        """Verdict of the whole recording."""
        return judge_together(self.checks)

    def judge_segment(self, segment: Segment) -> CalibrationVerdict:
        """Verdict of one sensor."""
        return judge_together(c for c in self.checks if c.segment == segment)

    def to_json(self) -> dict[str, object]:
        """Verdicts of the recording and its sensors, and every check, as JSON values."""
        segments = [s for s in SEGMENTS if any(c.segment == s for c in self.checks)]
        return {
            "verdict": self.verdict,
            "segments": {s: self.judge_segment(s) for s in segments},
            "checks": [c.to_json() for c in self.checks],
        }


def judge_together(checks: Iterable[CalibrationCheck]) -> CalibrationVerdict:
    """Combined verdict: "redo" if any check requires it, "pass" if any check passed and none requires a
    redo.
    """
    verdicts = {c.verdict for c in checks}
    return "redo" if "redo" in verdicts else "pass" if "pass" in verdicts else "not_judged"


def score_calibration(
    calibrated: CalibratedRecording,
    params: ScoreParams | None = None,
    agreed: Agreement | None = None,
    turned: Mapping[Segment, float] | None = None,
) -> CalibrationScore:
    """Score a calibration by all checks applicable to its recording.

    Parameters
    ----------
    calibrated : with the alignments in use. agreed : result of comparing the sensors with each other, None if
    not compared. turned : segment → correction of its forward axis by the joint estimation, rad.
    """
    view = _Evidence(calibrated, params or ScoreParams(), agreed, turned or {})
    moved = {s for s, x in calibrated.calibration.segments.items() if x.method in FUNCTIONAL}
    walked = set(calibrated.calibration.segments) - moved
    checks = [view.check_steps()] if walked or not moved else []
    for segment in (s for s in SEGMENTS if s in calibrated.recording.sensors):
        if segment not in calibrated.calibration.segments:
            checks.append(view.tell_missing(segment))
            continue
        checks += [
            CalibrationCheck("forward_found", segment, None, None, "pass"),
            view.check_stillness(segment),
            view.check_gravity(segment),
            view.check_axis_share(segment),
            *([view.check_repetitions(segment)] if segment in moved else []),
            view.check_mirror(segment),
            view.check_knee_axis(segment),
            view.check_joints(segment),
            view.check_heading_spread(segment),
        ]
    return CalibrationScore(tuple(checks))


class _Evidence:
    """Data for the checks, computed once."""

    def __init__(
        self,
        calibrated: CalibratedRecording,
        params: ScoreParams,
        agreed: Agreement | None,
        turned: Mapping[Segment, float],
    ) -> None:
        self.recording, self.calibration = calibrated.recording, calibrated.calibration
        self.params, self.agreed, self.turned = params, agreed, turned
        rate = self.recording.rate_hz
        self.straight = np.zeros(len(self.recording.t_s), np.bool_)
        for window in self.calibration.walking:
            self.straight[index_window(window, rate)] = True
        # before the rates of all sensors are held
        self.knees = measure_knees(calibrated)
        self.rates: dict[Segment, Floats] = {
            s: (self.recording.sensors[s].gyr - x.gyro_bias) @ x.R_segment_sensor.T
            for s, x in self.calibration.segments.items()
        }
        self.axes = {s: self._find_axis(s) for s in self.rates}

    def _seen(self, *segments: Segment) -> Bools:
        """Samples (n,) of straight walking with all of these sensors available."""
        valid = [self.recording.sensors[s].valid for s in segments]
        return np.asarray(np.logical_and.reduce([self.straight, *valid]))

    def _find_axis(self, segment: Segment) -> tuple[float, float] | None:
        """Deviation of the rotation axis from the medio-lateral axis, rad, and the share of that axis."""
        mask = self._seen(segment)
        if segment in TRUNK or np.count_nonzero(mask) < TURNED_ALL * self.recording.rate_hz:
            return None
        axis = measure_main_axis(self.rates[segment][mask][:, [0, 2]])
        heading = float(np.arctan2(axis.x, axis.z))
        return 0.5 * float(wrap_angle(2.0 * heading)), axis.share

    def _judge(self, name: CheckName, segment: Segment | None, value: float) -> CalibrationCheck:
        rule, limit = RULE_OF[name], float(getattr(self.params, name))
        good = value >= limit if rule.least else value <= limit
        return CalibrationCheck(
            name, segment, value, limit, "pass" if good else "redo", "" if good else rule.means
        )

    def _leave(
        self, name: CheckName, segment: Segment | None, reason: str, value: float | None = None
    ) -> CalibrationCheck:
        limit = float(getattr(self.params, name))
        return CalibrationCheck(name, segment, value, limit, "not_judged", reason)

    def tell_missing(self, segment: Segment) -> CalibrationCheck:
        messages = [n.message for n in self.calibration.notices if n.sensor == segment]
        reason = messages[0] if messages else RULE_OF["forward_found"].means
        return CalibrationCheck("forward_found", segment, None, None, "redo", reason)

    def check_repetitions(self, segment: Segment) -> CalibrationCheck:
        """Number of swings or bows available for this sensor."""
        facts = self._facts(segment)
        done, requested = float(facts["repetitions"]), float(facts["asked"])
        reason = "" if done >= requested else RULE_OF["repetitions"].means
        verdict: CalibrationVerdict = "redo" if reason else "pass"
        return CalibrationCheck("repetitions", segment, done, requested, verdict, reason)

    def _facts(self, segment: Segment) -> Mapping[str, Any]:
        """Diagnostics on how the forward axis was determined."""
        facts = self.calibration.diagnostics.get(segment)
        return facts if isinstance(facts, Mapping) else {}

    def check_steps(self) -> CalibrationCheck:
        steps = self.calibration.straight_steps
        if steps is None:
            return self._leave("repetitions", None, "No leg sensor shows steps of straight walking.")
        return self._judge("repetitions", None, float(steps))

    def check_stillness(self, segment: Segment) -> CalibrationCheck:
        if self.calibration.posture != "standing":
            return self._leave("stillness", segment, "No quiet standing; calibrated from walking alone.")
        part = index_window(self.calibration.zero, self.recording.rate_hz)
        turned, _ = measure_turn(self.recording.sensors[segment].cut("acc", part), self.recording.rate_hz)
        return self._judge("stillness", segment, degrees(turned))

    def check_gravity(self, segment: Segment) -> CalibrationCheck:
        if self.calibration.posture != "standing":
            return self._leave("gravity", segment, "No quiet standing; calibrated from walking alone.")
        norm = self.calibration.segments[segment].rest_norm
        return self._judge("gravity", segment, 100.0 * abs(norm / GRAVITY - 1.0))

    def check_axis_share(self, segment: Segment) -> CalibrationCheck:
        if self.calibration.segments[segment].method in FUNCTIONAL:
            return self._judge("axis_share", segment, float(self._facts(segment)["rho"]))
        if segment in TRUNK:
            return self._leave("axis_share", segment, "The trunk rotates about all axes in walking.")
        axis = self.axes[segment]
        if axis is None:
            return self._leave("axis_share", segment, "No straight walking available.")
        return self._judge("axis_share", segment, axis[1])

    def check_mirror(self, segment: Segment) -> CalibrationCheck:
        pair = next((p for p in (THIGH, SHANK, FOOT) if segment in p.values()), None)
        if pair is None:
            return self._leave("mirror", segment, "No sensor on the other side to compare with.")
        side_axes = [self.axes.get(s) for s in pair.values()]
        available = [x for x in side_axes if x is not None]
        if len(available) < len(side_axes):
            return self._leave("mirror", segment, "No calibrated sensor with walking data on the other side.")
        apart = degrees(abs(float(wrap_angle(available[0][0] + available[1][0]))))
        if min(share for _, share in available) < GOOD_AXIS:
            return self._leave("mirror", segment, "Its main axis of rotation is not clear enough.", apart)
        return self._judge("mirror", segment, apart)

    def check_knee_axis(self, segment: Segment) -> CalibrationCheck:
        side = next((s for s in SIDES if segment in (THIGH[s], SHANK[s])), None)
        if side is None:
            return self._leave("knee_axis", segment, "Not adjacent to a knee.")
        axes = self.knees.get(side)
        if axes is None:
            return self._leave(
                "knee_axis",
                segment,
                Message(
                    "Thigh and shank were not both recorded for {KNEE_SEEN:.0f} s of walking.",
                    KNEE_SEEN=KNEE_SEEN,
                ),
            )
        apart = degrees(abs(float(wrap_angle(axes.apart))))
        if axes.steepest > STEEPEST:
            return self._leave(
                "knee_axis", segment, "Soft-tissue motion is too large to determine the knee axis.", apart
            )
        return self._judge("knee_axis", segment, apart)

    def check_joints(self, segment: Segment) -> CalibrationCheck:
        """Best misfit of its joints: a sensor next to a single wrong sensor still fits its other
        neighbour.
        """
        misfits = {} if self.agreed is None else self.agreed.misfits
        own = [x for joint, x in misfits.items() if segment in joint]
        if not own:
            return self._leave("joint_misfit", segment, "No adjacent segment has a sensor with walking data.")
        return self._judge("joint_misfit", segment, min(own))

    def check_heading_spread(self, segment: Segment) -> CalibrationCheck:
        """Largest deviation of the axis in use from the accepted measures of forward and from the initial
        calibration.
        """
        facts = self._facts(segment)
        back = float(self.turned.get(segment, 0.0))
        measures = [back] if segment in self.turned else []
        off = facts.get("disagreement_rad")
        if facts.get("source") == "strides" and isinstance(off, float | int):
            # a foot keeps the way of its strides, whatever speaks against it
            measures += [back, float(wrap_angle(float(off) + back))]
        measures += [
            float(wrap_angle(v["off_rad"] + back))
            for v in facts.get("votes", ())
            if v["source"] in OF_FORWARD and v["share"] >= HEARD
        ]
        if not measures:
            return self._leave(
                "heading_spread", segment, "Only one estimate of its forward direction is available."
            )
        return self._judge("heading_spread", segment, degrees(max(map(abs, measures))))
