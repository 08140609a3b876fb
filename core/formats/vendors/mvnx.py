"""Xsens MVNX: XML of MVN and Xsens Analyze, version 4 (docs/reference/formats.md, "MVNX").

It holds no raw inertial signals. Specific force is reconstructed from orientation R (sensor → a frame with z
up) and free acceleration a (in that frame, m/s²) as Rᵀ(a + g e_z); the angular rate from consecutive
orientations as the mean over the intervals before and after a frame, which slightly attenuates fast
rotations.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NoReturn
from xml.parsers import expat

import numpy as np
from defusedxml import DTDForbidden

from sagittal.core import rotation
from sagittal.core.errors import FormatError, Notice
from sagittal.core.formats import text
from sagittal.core.formats.aliases import segment_named
from sagittal.core.formats.draft import Draft, grade_loss, make_draft
from sagittal.core.formats.source_spec import SourceSpec
from sagittal.core.frames import GRAVITY, Floats

LABEL: Final = "Xsens MVNX"
_MOST_SENSORS: Final = 64
_MOST_FRAMES: Final = 10_000_000
_WIDTHS: Final = {"sensorOrientation": 4, "sensorFreeAcceleration": 3, "sensorMagneticField": 3}
"""Elements of a frame that are read → numbers per sensor."""
_AGAIN: Final = "Export it from MVN again with sensor data switched on."


def looks_like(data: bytes) -> bool:
    """Whether the root element is that of MVNX."""
    return data.lstrip()[:1] == b"<" and b"<mvnx" in data[:4096]


def read(data: bytes, source: str, spec: SourceSpec | None = None) -> tuple[Draft, ...]:
    """Read every sensor of a file.

    Raises
    ------
    FormatError `bad_xml` (not well formed, or with a DTD, which is rejected), `missing_acc`, `empty`.
    """
    reader = _Reader(source)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    # without a DTD there are no entities to expand
    parser.StartDoctypeDeclHandler = _refuse_dtd
    parser.StartElementHandler, parser.EndElementHandler = reader.begin, reader.end
    parser.CharacterDataHandler = reader.add_text
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, DTDForbidden, ValueError, LookupError) as e:  # LookupError: of its encoding
        raise FormatError(
            "bad_xml", f"{source} is not readable XML ({type(e).__name__}); export it again."
        ) from e
    return reader.finish(spec)


def _refuse_dtd(name: str, system_id: str | None, public_id: str | None, _: bool) -> NoReturn:
    raise DTDForbidden(name, system_id, public_id)


class _Reader:
    """Collects labels, the rate and the frames of a file."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._labels: list[str] = []
        self._rate: float | None = None
        self._rows: list[str] = []
        self._broken = 0
        self._frame: Mapping[str, str] | None = None
        self._said: dict[str, list[str]] = {}
        self._part: list[str] | None = None
        self._depth = 0

    def begin(self, tag: str, attributes: Mapping[str, str]) -> None:
        """Handle the start of an element."""
        name = tag.rsplit(":", 1)[-1] if ":" in tag else tag
        if self._frame is not None:
            self._depth += 1
            # what is inside of a part of a frame is not read
            self._part = None
            if self._depth == 1 and name in _WIDTHS:
                self._said[name] = self._part = []
        elif name == "frame":
            self._frame, self._said, self._part, self._depth = attributes, {}, None, 0
        elif name == "sensor" and (label := attributes.get("label")):
            self._labels.append(label)
            if len(self._labels) > _MOST_SENSORS:
                raise FormatError("bad_table", f"{self._source} names more than {_MOST_SENSORS} sensors.")
        elif name == "subject":
            self._rate = _number(attributes.get("frameRate"))

    def add_text(self, content: str) -> None:
        """Handle text of the innermost element."""
        if self._part is not None:
            self._part.append(content)

    def end(self, tag: str) -> None:
        """Handle the end of an element."""
        if self._frame is None:
            return
        self._part = None
        if self._depth:
            self._depth -= 1
            return
        frame, self._frame = self._frame, None
        if frame.get("type", "normal") == "normal":
            self._take_frame(_number(frame.get("index")))

    def _take_frame(self, index: float | None) -> None:
        sensors = len(self._labels)
        cells: list[str] = []
        whole = index is not None
        for name, width in _WIDTHS.items():
            part = "".join(self._said.get(name, ())).split()
            if not part and name == "sensorMagneticField":
                part = ["NaN"] * (width * sensors)
            # what one part lacks another may have too much of
            whole = whole and len(part) == width * sensors
            cells += part
        if index is None or not whole:
            self._broken += 1
            return
        if len(self._rows) > _MOST_FRAMES:
            raise FormatError(
                "bad_table", f"{self._source} has more than {_MOST_FRAMES} frames; export it in parts."
            )
        self._rows.append(f"{index:.0f} {' '.join(cells)}")

    def finish(self, spec: SourceSpec | None) -> tuple[Draft, ...]:
        """The sensors in SI units."""
        rate = spec.rate_hz if spec and spec.rate_hz else self._rate
        if not self._labels or not self._rows:
            raise FormatError(
                "missing_acc" if self._broken else "empty",
                f"{self._source} holds no frames with orientation and free acceleration of sensors. {_AGAIN}",
            )
        if rate is None or not 1.0 <= rate <= 10_000.0:
            raise FormatError(
                "rate_missing", f"{self._source} names no frame rate; name rate_hz in a manifest."
            )
        notices = [self._derived()]
        if self._broken:
            notices.append(
                Notice(
                    "truncated_line",
                    f"{self._source}: {self._broken} frames lack the sensors' signals and were left out.",
                    severity=grade_loss(self._broken, self._broken + len(self._rows)),
                )
            )
        table = self._read_rows()
        index = table.values["index"]
        drafts = []
        for k, label in enumerate(self._labels):
            q, free, mag = (table.stack(_columns(name, k)) for name in _WIDTHS)
            q = _unit(q)
            drafts.append(
                make_draft(
                    label,
                    self._source,
                    "counter",
                    index,
                    acc=rotation.rotate(rotation.conjugate(q), free + np.array([0.0, 0.0, GRAVITY])),
                    gyr=_rates(q, index, rate),
                    mag=mag,
                    quat=q,
                    rate_hz=rate,
                    # what is wrong with the file is said once
                    notices=[*notices, *table.notices] if k == 0 else (),
                    segment=segment_named(label),
                )
            )
        return tuple(drafts)

    def _read_rows(self) -> text.Columns:
        """The numbers of all frames."""
        names = [c for name in _WIDTHS for k in range(len(self._labels)) for c in _columns(name, k)]
        body = memoryview("\n".join(self._rows).encode())
        return text.read_columns(
            body, self._source, b" ", ["index", *names], ["index", *names], decimal_comma=False
        )

    def _derived(self) -> Notice:
        return Notice(
            "signals_derived",
            f"{self._source} holds no raw signals; acceleration and angular rate were made from its "
            "orientations and free acceleration.",
            severity="info",
        )


def _columns(name: str, sensor: int) -> list[str]:
    return [f"{name} {sensor} {part}" for part in range(_WIDTHS[name])]


def _unit(q: Floats) -> Floats:
    """Unit quaternions, NaN if missing."""
    norm = np.linalg.norm(q, axis=-1, keepdims=True)
    good = (norm > 0.9) & (norm < 1.1)
    return np.where(good, q / np.where(good, norm, 1.0), np.nan)


def _rates(q: Floats, index: Floats, rate_hz: float) -> Floats:
    """Angular rate (n, 3) rad/s in the sensor's axes, from the steps before and after each frame."""
    rates = np.full((len(q), 3), np.nan)
    if len(q) < 2:
        return rates
    step_s = np.diff(index) / rate_hz
    turn = rotation.log(rotation.multiply(rotation.conjugate(q[:-1]), q[1:]))
    step_rates = turn / np.where(step_s > 0, step_s, np.nan)[:, None]
    rates[1:-1] = (step_rates[:-1] + step_rates[1:]) / 2
    rates[0], rates[-1] = step_rates[0], step_rates[-1]
    return rates


def _number(attribute: str | None) -> float | None:
    try:
        value = float(attribute or "")
    except ValueError:
        return None
    return value if np.isfinite(value) and abs(value) < 1e12 else None
