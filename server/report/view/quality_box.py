"""Data quality: the box at the top, in words and a few numbers."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, cast

from sagittal.core.activity.parameters import WORN_H
from sagittal.core.message import Message
from sagittal.core.parameters.result import Parameter
from sagittal.core.plurals import plural
from sagittal.core.quality import concern_paths_alone, find_shown_level
from sagittal.core.quality.assessment import Verdict
from sagittal.core.squat.repetitions import FOOT_LIFTED
from sagittal.server.report.files.bundle import Bundle, is_functional
from sagittal.server.report.words.estimator import estimator_view
from sagittal.server.report.words.wording import format_number, place_words, speak_places

CALIBRATION_METHODS: Final[Mapping[str, str]] = {
    "walking_direction": "from standing and walking",
    "gyro_pca": "from leg rotation",
    "declared": "declared placement",
    "neighbour": "inferred from adjacent segments",
    "fixed_offset": "placed according to protocol",
    "table_top": "transferred from a table",
    "hip_swing": "from leg swings",
    "trunk_bow": "from trunk bows",
}
"""Method of a calibration → words."""

NO_WHOLE_DAY: Final = Message(
    "No day has {WORN_H:g} hours of wear time, so no values per day are reported.", WORN_H=WORN_H
)
IN_DOUBT: Final = "Some values are not reported or are unreliable."


@dataclass(frozen=True)
class QualityItem:
    """One fact: a text, or a count of strides per side.

    Parameters
    ----------
    kind : ok, warn or bad if it is an assessment. page : session page with details.
    """

    label: str
    value: str = ""
    extra: str = ""
    kind: str | None = None
    page: str | None = None
    sides: bool = False
    left: int = 0
    left_of: int = 0
    right: int = 0
    right_of: int = 0


@dataclass(frozen=True)
class QualityBox:
    """Overall quality (`kind` ok, warn, bad and its word) and supporting facts.

    Parameters
    ----------
    reason : why the data are not good, in sentences; empty if they are. more : number of further warnings.
    """

    kind: str
    word: str
    items: tuple[QualityItem, ...]
    reason: str = ""
    more: int = 0


def quality_box(bundle: Bundle) -> QualityBox:
    """Assess the data quality of a finished analysis.

    Bad if the analysis stopped, no stride is included, the signals are poor or the estimator reports its
    result as unreliable; warn if the signals are only usable, the estimator reports doubts, any stage has a
    warning or no day of daily life is complete; otherwise ok. Informational notices have no effect.
    """
    kind, word = data_verdict(
        bundle.quality, bundle.estimator, {n.severity for n in bundle.warnings}, bundle.parameters
    )
    items = [
        *_counted(bundle),
        *_signals(bundle.quality, with_rest=bundle.activity is None),
        *_calibration(
            bundle.calibration,
            bundle.calibration_score,
            needed=bundle.activity is None
            and (
                bool(bundle.strides.strides)
                or not (_trunk_steps(bundle.parameters) or is_test(bundle.parameters))
            ),
        ),
        *_estimator(bundle.estimator),
    ]
    reason, more = explain_verdict(kind, bundle)
    return QualityBox(kind, word, tuple(items), reason, more)


def explain_verdict(kind: str, bundle: Bundle) -> tuple[str, int]:
    """Reason why the data are not good, and the number of further warnings.

    Errors that stopped the analysis come first, then contradictory sensors, a failed sensor, and the first of
    the other warnings.
    """
    if kind == "ok":
        return "", 0
    daily = _daily_steps(bundle.parameters)
    if kind == "warn" and daily is not None and not daily.n:
        return NO_WHOLE_DAY, sum(n.severity == "warning" for n in bundle.warnings)
    problems = [n for n in bundle.warnings if n.severity in ("error", "warning")]
    problems.sort(key=lambda n: (n.severity != "error", n.code != "sensor_failed"))
    health = None if bundle.estimator is None else bundle.estimator["verdict"]
    reasons = tuple(bundle.quality.get("reasons", ()))
    if kind == "bad" and health == "bad" and reasons and not (problems and problems[0].severity == "error"):
        return speak_places(reasons[-1]), len(problems)
    if problems:
        return speak_places(problems[0].message), len(problems) - 1
    if reasons:
        return speak_places(reasons[0]), 0
    return (IN_DOUBT if kind == "bad" else ""), 0


def data_verdict(
    quality: Mapping[str, Any],
    estimator: Mapping[str, Any] | None,
    severities: Collection[str],
    parameters: Sequence[Parameter],
) -> tuple[str, str]:
    """Symbol (ok, warn, bad) and word for the data quality, used in all lists and pages.

    Parameters
    ----------
    quality, estimator : of analysis.json. severities : of its notices. parameters : current values.
    """
    health = None if estimator is None else cast("Verdict", estimator["verdict"])
    level = find_shown_level(quality.get("level", "good"), health)
    if "error" in severities:
        return "bad", "Analysis stopped"
    squats = _squats(parameters)
    if squats and not any(p.n for p in squats):
        return "bad", "No squats"
    if is_test(parameters):
        total = next((p for p in parameters if is_functional(p.name) and p.mean is not None), None)
        if total is None:
            return "bad", "Test not found"
    walked = (
        is_test(parameters)
        or any(p.name == "stride_time_s" and p.n for p in parameters)
        or _trunk_steps(parameters)
    )
    daily = _daily_steps(parameters)
    if not squats and daily is None and not walked:
        return "bad", "No strides"
    if level == "poor":
        return "bad", "Poor data" if estimator is None or health != "bad" else _name_bad_estimate(estimator)
    if level == "usable" or "warning" in severities:
        return "warn", "Usable with caution"
    if daily is not None and not daily.n:
        return "warn", "No complete day"
    return "ok", "Good data"


def _name_bad_estimate(estimator: Mapping[str, Any]) -> str:
    """The inconsistency: between sensors, or between a foot's path and its rest periods."""
    bad = [f["name"] for f in estimator.get("health", ()) if f["verdict"] == "bad"]
    return "Foot path unreliable" if concern_paths_alone(bad) else "Sensors disagree"


def _trunk_steps(parameters: Sequence[Parameter]) -> int:
    """Number of steps detected by a trunk sensor, if there are no foot sensors."""
    return next((int(p.mean) for p in parameters if p.name == "step_count" and p.mean is not None), 0)


def is_test(parameters: Sequence[Parameter]) -> bool:
    """Whether the trial is a functional test."""
    return any(is_functional(p.name) for p in parameters)


def _squats(parameters: Sequence[Parameter]) -> list[Parameter]:
    """Depth of squats of each leg, with the number of included ones; empty for other trials."""
    return [p for p in parameters if p.name == "squat_depth_deg"]


def _daily_steps(parameters: Sequence[Parameter]) -> Parameter | None:
    """Steps per day of a daily-life recording, with the number of days; None for other trials."""
    return next((p for p in parameters if p.name == "daily_step_count"), None)


def _counted(bundle: Bundle) -> list[QualityItem]:
    """Included strides of the feet, otherwise steps from the trunk; for squats the included repetitions.

    For daily life the hours of wear, and the number of days with sufficient wear time.
    """
    if bundle.activity is not None:
        hours = sum(day.worn_h for day in bundle.activity.days)
        whole, days = _daily_steps(bundle.parameters), len(bundle.activity.days)
        return [
            QualityItem("Worn", f"{format_number(hours, 1)}\u202fh"),
            QualityItem(
                "Days included", f"{0 if whole is None else whole.n} of {days}", "worn 10 h or longer"
            ),
        ]
    if is_test(bundle.parameters) and not bundle.strides.strides:
        return []
    squats = _squats(bundle.parameters)
    if squats:
        done = [p for p in squats if p.n] or squats
        if len(done) == 1:
            return [QualityItem("Squats included", str(done[0].n), Message("{side} leg", side=done[0].side))]
        return [_squats_of_both(bundle)]
    steps = _trunk_steps(bundle.parameters)
    if steps and not bundle.strides.strides:
        return [QualityItem("Steps", str(steps), "trunk sensor")]
    return [_strides(bundle)]


def _squats_of_both(bundle: Bundle) -> QualityItem:
    own = [r for r in bundle.repetitions or () if r.excluded != FOOT_LIFTED]
    left, right = ([r for r in own if r.side == side] for side in ("left", "right"))
    return QualityItem(
        "Squats included",
        sides=True,
        left=sum(r.excluded is None for r in left),
        left_of=len(left),
        right=sum(r.excluded is None for r in right),
        right_of=len(right),
    )


def _strides(bundle: Bundle) -> QualityItem:
    left, right = ([s for s in bundle.strides.strides if s.side == side] for side in ("left", "right"))
    return QualityItem(
        "Strides included",
        sides=True,
        left=sum(s.excluded_reason is None for s in left),
        left_of=len(left),
        right=sum(s.excluded_reason is None for s in right),
        right_of=len(right),
    )


def _signals(quality: Mapping[str, Any], *, with_rest: bool) -> list[QualityItem]:
    """Lost samples of the worst sensor, magnetic field, and still periods if required by the analysis."""
    items = []
    sensors = [s for s in quality.get("sensors", ()) if isinstance(s, Mapping)]
    lost = [(float(s["lost_pct"]), _sensor_name(s)) for s in sensors if s.get("lost_pct") is not None]
    if lost:
        worst, name = max(lost)
        extra = "" if worst == 0 else Message("at most, {name}", name=name)
        items.append(QualityItem("Lost samples", f"{format_number(worst, 1)} %", extra))
    still = quality.get("rest_s") if with_rest else None
    if still is not None:
        total = sum(end - start for start, end in still)
        times = Message("in {still} parts", still=len(still)) if len(still) > 1 else ""
        items.append(QualityItem("Standing still", f"{format_number(total, 1)} s", times))
    magnetic = [float(s["magnetic_pct"]) for s in sensors if s.get("magnetic_pct") is not None]
    if magnetic:
        share = (
            Message("disturbed {format_number} % of the time", format_number=format_number(max(magnetic)))
            if max(magnetic) >= 1
            else "steady"
        )
        items.append(QualityItem("Magnetic field", share, "not used"))
    return items


def _calibration(
    calibration: Mapping[str, Any] | None, score: Mapping[str, Any] | None, *, needed: bool
) -> list[QualityItem]:
    """Calibration method, number of checks passed, and zero of the angles."""
    if calibration is None:
        # steps of a trunk sensor are measured without alignment
        return [] if not needed else [QualityItem("Calibration", "not reached", kind="bad")]
    method = CALIBRATION_METHODS.get(calibration["method"], str(calibration["method"]).replace("_", " "))
    if calibration.get("posture") == "walking" and calibration["method"] == "walking_direction":
        method = "from walking alone"
    verdicts = [c["verdict"] for c in (score or {"checks": ()})["checks"] if c["verdict"] != "not_judged"]
    if verdicts:
        passed = verdicts.count("pass")
        kind = None if passed == len(verdicts) else "warn"
        value = Message(
            f"{{passed}} of {{verdicts}} {plural(len(verdicts), 'check', 'checks')}",
            passed=passed,
            verdicts=len(verdicts),
        )
        items = [QualityItem("Calibration", value, method, kind=kind, page="calibration")]
    else:
        items = [QualityItem("Calibration", method)]
    if calibration.get("posture", "standing") == "walking":
        items.append(QualityItem("Posture", "from walking", "no usable standing", kind="warn"))
    if calibration.get("angle_zero") is not None:
        items.append(QualityItem("Angle zero", str(calibration["angle_zero"])))
    return items


def _estimator(section: Mapping[str, Any] | None) -> list[QualityItem]:
    view = estimator_view(section)
    if view is None:
        return []
    extra = view.reduced or view.verdict
    kind = None if view.kind == "ok" and view.reduced is None else view.kind
    return [
        QualityItem("Pose estimator", view.name, extra, kind="warn" if kind == "ok" else kind, page="data")
    ]


def _sensor_name(sensor: Mapping[str, Any]) -> str:
    return place_words(str(sensor.get("segment") or sensor.get("device_id") or ""))
