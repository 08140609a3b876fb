"""View of a functional test: total, phases as a bar and a table, norm, previous visit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from sagittal.core.message import Message
from sagittal.core.norms.functional import (
    COMFORTABLE_SPEED_SOURCE,
    SIX_MINUTE_SOURCE,
    TEST_NORMS,
    find_comfortable_speed,
    find_six_minute_norm,
    find_test_norm,
)
from sagittal.core.parameters.catalogue import CATALOGUE, require_entries
from sagittal.core.parameters.result import Parameter
from sagittal.server.report.charts.svg import format_coordinate, stretch
from sagittal.server.report.files.bundle import Bundle
from sagittal.server.report.words.wording import (
    format_number,
    format_uncertainty,
    parameter_term,
    place_words,
    reason_words,
)

TOTALS: Final = (
    "tug_duration_s",
    "five_sit_to_stand_s",
    "walk_10m_speed_mps",
    "walk_6min_distance_m",
    "sway_rms_mps2",
)
"""Main parameter of a test, by what was measured."""

require_entries(TOTALS, "sagittal.server.report.view.functional")

SEGMENTS: Final[Mapping[str, str]] = {
    "sit_to_stand": "Rising",
    "walk_out": "Walk out",
    "turn": "Turn",
    "walk_back": "Walk back",
    "turn_to_sit": "Turn and sitting down",
    "stand_to_sit": "Sitting down",
    "speeding_up": "Speeding up",
    "timed_metres": "Timed metres",
    "slowing_down": "Slowing down",
    "standing": "Quiet standing",
}
"""Name of a phase → label; minutes are numbered automatically."""

MEANT: Final[Mapping[str, str]] = {
    "tug_duration_s": "From the first lean forward to the end of sitting down.",
    "five_sit_to_stand_s": "From the first lean forward to the end of the fifth sitting down.",
    "walk_10m_speed_mps": "Over the middle of the longest straight walk, excluding two metres at each end.",
    "walk_6min_distance_m": "From the strides of the feet, turns included.",
    "sway_rms_mps2": "From the horizontal acceleration below 3.5 Hz; the forward direction is unknown.",
}
"""Explanation of the total of a test."""

TEST_NORM_NOTE: Final = "If a norm exists for the test, it is shown below its phases."
"""Shown below the table of a test's parameters."""

NO_NORM: Final = "No norm: no published values for this test."
NO_AGE: Final = "No norm: enter the year of birth."
NO_SEX: Final = "No norm: enter the sex."
OTHER_AGE: Final = "No norm for this age."


@dataclass(frozen=True)
class SegmentRow:
    """A phase of a test in words; `length_s` for the bar."""

    label: str
    start: str
    duration: str
    length_s: float


@dataclass(frozen=True)
class FunctionalView:
    """View of a functional test.

    Parameters
    ----------
    name, title, unit : main parameter. value : as printed, "–" if missing, with a `reason`.
    plus_minus : uncertainty. norm : healthy subjects with source, or why there is none.
    previous : value at the previous visit, as printed, "" without one.
    start_s, end_s : of the test, None if not detected. sensor : sensor used. corrected : limits set by a
        user.
    """

    name: str
    title: str
    value: str
    unit: str
    plus_minus: str
    reason: str | None
    norm: str
    meant: str
    segments: tuple[SegmentRow, ...]
    start_s: float | None
    end_s: float | None
    sensor: str
    corrected: bool
    previous: str = ""

    @property
    def bar(self) -> str:
        """The phases as a bar in SVG, with widths proportional to duration."""
        total = sum(s.length_s for s in self.segments)
        if total <= 0.0 or len(self.segments) < 2:
            return ""
        x, shapes = 0.0, []
        for i, segment in enumerate(self.segments):
            width = 1000.0 * segment.length_s / total
            wide = format_coordinate(max(width - 3.0, 1.0))
            box = f'x="{format_coordinate(x)}" y="0" width="{wide}" height="1000"'
            shapes.append(f'<rect class="seg1" {box}/>' if i % 2 else f'<rect class="seg0" {box}/>')
            x += width
        labels = ", ".join(f"{s.label} {s.duration} s" for s in self.segments)
        return (
            f'<svg class="chart segbar" width="100%" height="28" role="img" aria-label="{labels}">'
            f"{stretch(''.join(shapes))}</svg>"
        )

    def compare_with(self, earlier: Sequence[Parameter]) -> FunctionalView:
        """The view with the value of an earlier visit."""
        value = next((p.mean for p in earlier if p.name == self.name), None)
        if value is None:
            return self
        return replace(self, previous=format_number(value, parameter_term(self.name).digits))


def functional_view(
    bundle: Bundle, age: float | None = None, sex: str | None = None
) -> FunctionalView | None:
    """The functional test of a finished analysis; None for other trials."""
    if bundle.functional is None:
        return None
    by_name = {p.name: p for p in bundle.parameters}
    total = next((by_name[name] for name in TOTALS if name in by_name), None)
    if total is None:
        return None
    term, test = parameter_term(total.name), bundle.functional
    sure = "" if total.uncertainty is None else format_uncertainty(total.uncertainty, term.digits)
    return FunctionalView(
        name=total.name,
        title=CATALOGUE[total.name].label,
        value="–" if total.mean is None else format_number(total.mean, term.digits),
        unit=term.unit,
        plus_minus=sure,
        reason=reason_words(total.reason) if total.mean is None else None,
        norm=norm_words(total.name, age, sex),
        meant=MEANT[total.name],
        segments=tuple(_segment(row) for row in test["segments"]),
        start_s=test["start_s"],
        end_s=test["end_s"],
        sensor=place_words(test["sensor"]) if test["sensor"] else "feet",
        corrected=bool(test["corrected"]),
    )


def _segment(row: Mapping[str, Any]) -> SegmentRow:
    name, start, end = str(row["name"]), float(row["start_s"]), float(row["end_s"])
    return SegmentRow(
        segment_label(name), format_number(start, 1), format_number(end - start, 1), end - start
    )


def segment_label(name: str) -> str:
    """Label of a phase."""
    return SEGMENTS.get(name, name.replace("_", " ").capitalize())


def norm_words(name: str, age: float | None, sex: str | None = None) -> str:
    """Performance of healthy subjects in a test, with the source, or the reason why no norm is shown."""
    if name in ("walk_10m_speed_mps", "walk_6min_distance_m"):
        if age is None or sex is None:
            return NO_AGE if age is None else NO_SEX
        return _speed_words(age, sex) if name == "walk_10m_speed_mps" else _distance_words(age, sex)
    if name not in TEST_NORMS:
        return NO_NORM
    norm = find_test_norm(name, age)
    if norm is None:
        return NO_AGE if age is None else OTHER_AGE
    limit = format_number(norm.limit_s, 1)
    people = Message("{ages} to {ages2} years", ages=norm.ages[0], ages2=norm.ages[1])
    mean = "" if norm.mean_s is None else Message("mean {mean_s} s, ", mean_s=format_number(norm.mean_s, 1))
    return Message(
        "Healthy people of {people}: {mean}slower than average above {limit} s ({source}).",
        people=people,
        mean=mean,
        limit=limit,
        source=norm.source,
    )


def _distance_words(age: float, sex: str) -> str:
    norm = find_six_minute_norm(age, sex)
    if norm is None:
        return OTHER_AGE
    people = Message(
        f"{'Men' if sex == 'male' else 'Women'} of {{ages}} to {{ages2}} years",
        ages=norm.ages[0],
        ages2=norm.ages[1],
    )
    mean, spread = format_number(norm.mean_m, 0), format_number(norm.sd_m, 0)
    far = Message("{mean} m on average, standard deviation {spread} m", mean=mean, spread=spread)
    return Message(
        "Healthy {lower} walk {far} ({SIX_MINUTE_SOURCE}).",
        lower=people.lower(),
        far=far,
        SIX_MINUTE_SOURCE=SIX_MINUTE_SOURCE,
    )


def _speed_words(age: float, sex: str) -> str:
    norm = find_comfortable_speed(age, sex)
    if norm is None:
        return OTHER_AGE
    people = Message(
        f"{'Men' if sex == 'male' else 'Women'} of {{ages}} to {{ages2}} years",
        ages=norm.ages[0],
        ages2=norm.ages[1],
    )
    mean = format_number(norm.mean_mps, 2)
    return Message(
        "{people} walk at {mean} m/s on average, at their own pace ({COMFORTABLE_SPEED_SOURCE}).",
        people=people,
        mean=mean,
        COMFORTABLE_SPEED_SOURCE=COMFORTABLE_SPEED_SOURCE,
    )
