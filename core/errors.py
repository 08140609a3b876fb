"""One exception tree and one notice type for all of core.

SagittalError
├── InputError           invalid file contents, manifest or archive
│   ├── FormatError      a file does not match any (or the declared) format
│   ├── ManifestError    the manifest is invalid or does not match the files
│   └── ArchiveError     an archive violates a limit (bomb, traversal, encryption, nesting)
├── SignalError          the file is readable but its signals are unusable (no_rest, bad_signal, gap …)
├── CalibrationError     the sensor-to-segment alignment cannot be estimated
├── EstimationError      a filter cannot produce a reliable result
└── ParameterError       an argument is outside its domain

Every message states the expected and the actual condition, the location (sensor, seconds) and the remedy.
`code` is stable: translations, tests and API clients rely on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from sagittal.core.message import describe_message, read_message

Severity = Literal["info", "warning", "error"]
"""error: numbers made from it would be wrong, so the analysis stops; warning: they are less certain."""


class SagittalError(Exception):
    """Base class of all errors shown to users; `code` is stable, the message is a sentence."""

    def __init__(
        self, code: str, message: str, *, sensor: str | None = None, t_s: float | None = None
    ) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
        self.sensor = sensor
        self.t_s = t_s

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle support: errors cross the pipe between a worker and its child process."""
        return _rebuild, (type(self), self.code, self.message, self.sensor, self.t_s)


class InputError(SagittalError):
    """Invalid file contents, manifest or archive."""


class FormatError(InputError):
    """A file does not match any (or the declared) format."""


class ManifestError(InputError):
    """The manifest is invalid or does not match the files."""


class ArchiveError(InputError):
    """An archive violates a limit: entries, size, ratio, nesting, encryption, path traversal."""


class SignalError(SagittalError):
    """The file is readable but its signals are unusable."""


class CalibrationError(SagittalError):
    """The sensor-to-segment alignment cannot be estimated."""


class EstimationError(SagittalError):
    """A filter cannot produce a reliable result."""


class ParameterError(SagittalError):
    """An argument is outside its domain."""


def _rebuild(
    kind: type[SagittalError], code: str, message: str, sensor: str | None, t_s: float | None
) -> SagittalError:
    return kind(code, message, sensor=sensor, t_s=t_s)


@dataclass(frozen=True)
class Notice:
    """Information, warning or error attached to a result; it never interrupts the analysis.

    Parameters
    ----------
    code : stable identifier, snake_case.
    message : one or two sentences: the observation (measured value, limit) and the remedy; a
        `Message` where it has values.
    sensor : segment or device id concerned, None for the whole recording.
    t_s : start in seconds from recording start, None if not tied to a point in time.
    severity : info, warning or error (see `Severity`).
    """

    code: str
    message: str
    sensor: str | None = None
    t_s: float | None = None
    severity: Severity = "warning"

    def to_json(self) -> dict[str, object]:
        """Return a JSON-serialisable dictionary, with `template` and `values` of a `Message`."""
        return {
            "code": self.code,
            **describe_message(self.message),
            "sensor": self.sensor,
            "t_s": self.t_s,
            "severity": self.severity,
        }

    @classmethod
    def from_json(cls, stored: Mapping[str, Any]) -> Notice:
        """Read what `to_json` wrote, now or before messages had templates."""
        return cls(
            stored["code"],
            read_message(stored),
            stored["sensor"],
            stored["t_s"],
            stored.get("severity", "warning"),
        )


TITLES: Final[Mapping[str, str]] = {
    "angles_withheld": "Angles not reported",
    "distances_withheld": "Distances not reported",
    "facing_not_walking": "Facing direction differs from walking direction",
    "figure_incomplete": "Avatar incomplete",
    "filters_left_out": "Filters excluded",
    "led_by_other": "Contacts from other detectors",
    "live_figure_lost": "Live avatar lost",
    "mounting_agreed": "Placement assumed",
    "mounting_not_as_agreed": "Placement differs from the protocol",
    "no_figure": "No avatar",
    "no_live_figure": "No live avatar",
    "no_open_take": "No open recording",
    "no_rest": "No still period",
    "no_standing": "No quiet standing",
    "others_found_contacts": "More contacts from other detectors",
    "same_session": "Same visit",
    "sensors_exchanged": "Sensors swapped",
    "session_planned": "Visit already planned",
    "setup_wrong": "Set-up wrong",
    "take_empty": "Recording empty",
    "take_known": "Recording already known",
    "take_open": "Recording in progress",
}
"""Titles of codes whose own words are not those of the field."""


def title_of_code(code: str) -> str:
    """Title of a notice or an error, from its code.

    >>> title_of_code("clock_drifts"), title_of_code("no_rest")
    ('Clock drifts', 'No still period')
    """
    return TITLES.get(code, code.replace("_", " ").capitalize())
