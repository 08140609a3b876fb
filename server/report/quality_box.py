"""Is the data good: the box above everything else, in words and a few numbers."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, cast

from core.parameters.result import Parameter
from core.quality import find_shown_level
from core.quality.assessment import Verdict
from server.report.bundle import Bundle
from server.report.estimator import estimator_view
from server.report.wording import format_number, place_words

_METHODS: Final[Mapping[str, str]] = {
    "walking_direction": "from standing and walking",
    "gyro_pca": "from leg rotation",
    "declared": "mounting as declared",
    "neighbour": "guessed from neighbours",
}


@dataclass(frozen=True)
class QualityItem:
    """One fact: a text, or a count of strides per side.

    Parameters
    ----------
    kind : ok, warn or bad where it is a judgement. page : of the session, where more about it stands.
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
    """Verdict (`kind` ok, warn, bad and its word) and the facts behind it."""

    kind: str
    word: str
    items: tuple[QualityItem, ...]


def quality_box(bundle: Bundle) -> QualityBox:
    """Judge a finished analysis.

    Bad when the analysis stopped, no stride counts, the signals are poor or the pose estimator cannot stand
    behind its result; warn when the signals are only usable, the estimator doubts or any stage has a warning;
    else ok.
    """
    kind, word = data_verdict(
        bundle.quality, bundle.estimator, {n.severity for n in bundle.warnings}, bundle.parameters
    )
    items = [
        *_counted(bundle),
        *_signals(bundle.quality),
        *_calibration(bundle.calibration, needed=not _trunk_steps(bundle.parameters)),
        *_estimator(bundle.estimator),
    ]
    return QualityBox(kind, word, tuple(items))


def data_verdict(
    quality: Mapping[str, Any],
    estimator: Mapping[str, Any] | None,
    severities: Collection[str],
    parameters: Sequence[Parameter],
) -> tuple[str, str]:
    """Shape (ok, warn, bad) and word for the data of an analysis; the same in every list and on its page.

    Parameters
    ----------
    quality, estimator : of analysis.json. severities : of its notices. parameters : as they count.
    """
    health = None if estimator is None else cast("Verdict", estimator["verdict"])
    level = find_shown_level(quality.get("level", "good"), health)
    if "error" in severities:
        return "bad", "Analysis stopped"
    if not any(p.name == "stride_time_s" and p.n for p in parameters) and not _trunk_steps(parameters):
        return "bad", "No strides"
    if level == "poor":
        return "bad", "Sensors disagree" if health == "bad" else "Poor data"
    if level == "usable" or "warning" in severities:
        return "warn", "Usable, see notices"
    return "ok", "Good data"


def _trunk_steps(parameters: Sequence[Parameter]) -> int:
    """Steps that a trunk sensor told, where no foot carries one."""
    return next((int(p.mean) for p in parameters if p.name == "step_count" and p.mean is not None), 0)


def _counted(bundle: Bundle) -> list[QualityItem]:
    """Strides of the feet, or steps of the trunk where there are none."""
    steps = _trunk_steps(bundle.parameters)
    if steps and not bundle.strides.strides:
        return [QualityItem("Steps", str(steps), "trunk sensor")]
    return [_strides(bundle)]


def _strides(bundle: Bundle) -> QualityItem:
    left, right = ([s for s in bundle.strides.strides if s.side == side] for side in ("left", "right"))
    return QualityItem(
        "Strides used",
        sides=True,
        left=sum(s.excluded_reason is None for s in left),
        left_of=len(left),
        right=sum(s.excluded_reason is None for s in right),
        right_of=len(right),
    )


def _signals(quality: Mapping[str, Any]) -> list[QualityItem]:
    """Lost samples of the worst sensor, rest, magnetic field."""
    items = []
    sensors = [s for s in quality.get("sensors", ()) if isinstance(s, Mapping)]
    lost = [(float(s["lost_pct"]), _sensor_name(s)) for s in sensors if s.get("lost_pct") is not None]
    if lost:
        worst, name = max(lost)
        extra = "" if worst == 0 else f"at most, {name}"
        items.append(QualityItem("Lost samples", f"{format_number(worst, 1)} %", extra))
    rest = quality.get("rest_s")
    if rest is not None:
        total = sum(end - start for start, end in rest)
        times = f"in {len(rest)} parts" if len(rest) > 1 else ""
        items.append(QualityItem("Standing still", f"{format_number(total, 1)} s", times))
    magnetic = [float(s["magnetic_pct"]) for s in sensors if s.get("magnetic_pct") is not None]
    if magnetic:
        share = f"disturbed {format_number(max(magnetic))} % of the time" if max(magnetic) >= 1 else "steady"
        items.append(QualityItem("Magnetic field", share, "not used"))
    return items


def _calibration(calibration: Mapping[str, Any] | None, *, needed: bool) -> list[QualityItem]:
    if calibration is None:
        # steps of a trunk sensor are read from it as it sits
        return [] if not needed else [QualityItem("Calibration", "not reached", kind="bad")]
    scores = [float(s["score"]) for s in calibration["segments"].values() if s.get("score") is not None]
    method = _METHODS.get(calibration["method"], str(calibration["method"]).replace("_", " "))
    if calibration.get("posture") == "walking" and calibration["method"] == "walking_direction":
        method = "from walking alone"
    value = f"{format_number(100 * min(scores))}" if scores else method
    items = [QualityItem("Calibration", value, f"/ 100, {method}" if scores else "")]
    if calibration.get("posture", "standing") == "walking":
        items.append(QualityItem("Posture", "from walking", "nobody stood still", kind="warn"))
    if calibration.get("angle_zero") is not None:
        items.append(QualityItem("Angle zero", str(calibration["angle_zero"])))
    return items


def _estimator(section: Mapping[str, Any] | None) -> list[QualityItem]:
    view = estimator_view(section)
    if view is None:
        return []
    extra = view.reduced or view.verdict
    kind = None if view.kind == "ok" and view.reduced is None else view.kind
    return [QualityItem("Poses by", view.name, extra, kind="warn" if kind == "ok" else kind, page="data")]


def _sensor_name(sensor: Mapping[str, Any]) -> str:
    return place_words(str(sensor.get("segment") or sensor.get("device_id") or ""))
