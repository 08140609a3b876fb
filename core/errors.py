"""One exception tree and one notice type for all of core.

SagittalError
├── InputError           the bytes, the manifest or the archive are not what was expected
│   ├── FormatError      a file cannot be read as any (or as the declared) format
│   ├── ManifestError    the manifest is not valid or does not fit the files
│   └── ArchiveError     a zip breaks a limit (bomb, traversal, encryption, nesting)
├── SignalError          the file is readable, the signals are not usable (no_rest, bad_signal, gap …)
├── CalibrationError     the sensor-to-segment orientation cannot be found
├── EstimationError      a filter cannot give a result it could stand behind
└── ParameterError       an argument of ours is outside its domain

Every message says what was expected, what was found, where (sensor, seconds) and what to do.
`code` is stable: translations, tests and API clients rely on it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from sagittal.core.message import describe_message, read_message

Severity = Literal["info", "warning", "error"]
"""error: numbers made from it would be wrong, so the analysis stops; warning: they are less certain."""


class SagittalError(Exception):
    """Base of all errors that are shown to a person; `code` is stable, the message is a sentence."""

    def __init__(
        self, code: str, message: str, *, sensor: str | None = None, t_s: float | None = None
    ) -> None:
        super().__init__(message)
        self.code = code
        self.message = message
        self.sensor = sensor
        self.t_s = t_s

    def __reduce__(self) -> tuple[object, ...]:
        """Survive the pipe between worker and its child."""
        return _rebuild, (type(self), self.code, self.message, self.sensor, self.t_s)


class InputError(SagittalError):
    """The bytes, the manifest or the archive are not what was expected."""


class FormatError(InputError):
    """A file cannot be read as any (or as the declared) format."""


class ManifestError(InputError):
    """The manifest is not valid or does not fit the files."""


class ArchiveError(InputError):
    """A zip breaks a limit: entries, size, ratio, nesting, encryption, path traversal."""


class SignalError(SagittalError):
    """The file is readable but its signals are not usable."""


class CalibrationError(SagittalError):
    """The sensor-to-segment orientation cannot be found."""


class EstimationError(SagittalError):
    """A filter cannot give a result it could stand behind."""


class ParameterError(SagittalError):
    """An argument is outside its domain."""


def _rebuild(
    kind: type[SagittalError], code: str, message: str, sensor: str | None, t_s: float | None
) -> SagittalError:
    return kind(code, message, sensor=sensor, t_s=t_s)


@dataclass(frozen=True)
class Notice:
    """Something the reader of a result must know; travels with the result, never stops it.

    Parameters
    ----------
    code : stable identifier, snake_case.
    message : one or two sentences: what was found (measured value, limit), what to do; a `Message` where it
        has values.
    sensor : segment or device id it concerns, None for the whole recording.
    t_s : start in seconds from recording start, None if it has no place in time.
    severity : info, warning or error (see `Severity`).
    """

    code: str
    message: str
    sensor: str | None = None
    t_s: float | None = None
    severity: Severity = "warning"

    def to_json(self) -> dict[str, object]:
        """Plain values for the wire; with `template` and `values` where the message has any."""
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
