"""APDM Opal: HDF5 files of version 5 (docs/reference/formats.md, "APDM"). Reading them needs h5py.

`Sensors/<id>`: Accelerometer m/s², Gyroscope rad/s, Magnetometer µT, (n, 3) each in the monitor's axes, Time
in µs since 1970; "Label 0" in its group Configuration gives the placement of the monitor.
`Processed/<id>/Orientation` (n, 4), scalar first. Links and layouts that refer to data outside the file are
rejected.
"""

from __future__ import annotations

import io
from typing import Any, Final

import numpy as np

from sagittal.core.errors import FormatError
from sagittal.core.formats.aliases import segment_named
from sagittal.core.formats.draft import Draft, make_draft
from sagittal.core.formats.source_spec import SourceSpec
from sagittal.core.frames import Floats

LABEL: Final = "APDM HDF5"
MAGIC: Final = b"\x89HDF\r\n\x1a\n"
_VERSION: Final = 5
_MOST_SENSORS: Final = 64
_MOST_VALUES: Final = 400_000_000
"""Numbers of a file: 24 monitors, a day at 128 Hz would be as many [our choice]."""
_INSTALL: Final = "Install it with: pip install 'sagittal[apdm]'."
_MICRO: Final = 1e-6


def looks_like(data: bytes) -> bool:
    """Whether the data have the signature of HDF5 and the group names of APDM."""
    return data.startswith(MAGIC) and b"Sensors" in data and b"Accelerometer" in data


def read(data: bytes, source: str, spec: SourceSpec | None = None) -> tuple[Draft, ...]:
    """Read every monitor of a file.

    Raises
    ------
    FormatError `reader_missing` without h5py, `bad_hdf5`, `unsupported_format` (version), `missing_acc`.
    """
    try:
        import h5py
    except ImportError:
        raise FormatError(
            "reader_missing", f"{source} is APDM HDF5; the server lacks h5py, which reads it. {_INSTALL}"
        ) from None
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            version = int(file.attrs.get("FileFormatVersion", 0))
            if version != _VERSION:
                raise FormatError(
                    "unsupported_format",
                    f"{source} is APDM HDF5 of version {version}, expected {_VERSION}; export it as CSV.",
                )
            return _read_monitors(_Tree(file, source), source, spec)
    except (
        OSError,
        RuntimeError,
        KeyError,
        ValueError,
        TypeError,
        AttributeError,
        OverflowError,
        MemoryError,
    ) as e:
        raise FormatError(
            "bad_hdf5", f"{source} is damaged HDF5 ({type(e).__name__}); copy it from the device again."
        ) from e


class _Tree:
    """Groups and arrays of a file, none of them external; counts the values requested."""

    def __init__(self, root: Any, source: str) -> None:
        self._root, self._source, self._values = root, source, 0

    def names(self, path: str) -> list[str]:
        """Members of a group, empty if it does not exist."""
        group = self._get(path)
        return list(group)[: _MOST_SENSORS + 1] if group is not None else []

    def array(self, path: str, width: int) -> Floats | None:
        """Numbers (n, width), or (n,) if the width is 1; None if absent."""
        dataset = self._get(path)
        if dataset is None:
            return None
        shape = (len(dataset), width) if width > 1 else (len(dataset),)
        if tuple(dataset.shape) != shape or dataset.dtype.kind not in "fiu":
            raise self._bad(f"{path} has shape {dataset.shape}, expected {shape}")
        if dataset.is_virtual or dataset.external is not None:
            raise self._bad(f"{path} lies in another file")
        self._values += dataset.size
        if self._values > _MOST_VALUES:
            raise self._bad("it declares more numbers than a day of recording")
        return np.asarray(dataset[()], np.float64)

    def said(self, path: str, name: str) -> str:
        """An attribute of a group as text, empty if absent."""
        group = self._get(path)
        value = "" if group is None else group.attrs.get(name, "")
        text = value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)
        return text.strip("\0 ")

    def _get(self, path: str) -> Any:
        node = self._root
        for part in path.split("/"):
            link = node.get(part, getlink=True)
            if link is None:
                return None
            if type(link).__name__ != "HardLink":
                raise self._bad(f"{path} is a link")
            node = node[part]
        return node

    def _bad(self, reason: str) -> FormatError:
        return FormatError("bad_hdf5", f"{self._source} is not readable: {reason}. Export it again.")


def _read_monitors(tree: _Tree, source: str, spec: SourceSpec | None) -> tuple[Draft, ...]:
    monitors = tree.names("Sensors")
    if not monitors or len(monitors) > _MOST_SENSORS:
        raise FormatError(
            "empty", f"{source} has {len(monitors)} monitors, expected 1 to {_MOST_SENSORS}; export it again."
        )
    drafts = []
    for monitor in monitors:
        prefix = f"Sensors/{monitor}"
        acc, time = tree.array(f"{prefix}/Accelerometer", 3), tree.array(f"{prefix}/Time", 1)
        if acc is None or time is None or len(acc) != len(time):
            raise FormatError(
                "missing_acc",
                f"{source}: monitor {monitor} has no acceleration with times; export it again with raw data.",
                sensor=monitor,
            )
        config = f"{prefix}/Configuration"
        gyr, mag, quat = (
            x if x is not None and len(x) == len(acc) else None
            for x in (
                tree.array(f"{prefix}/Gyroscope", 3),
                tree.array(f"{prefix}/Magnetometer", 3),
                tree.array(f"Processed/{monitor}/Orientation", 4),
            )
        )
        drafts.append(
            make_draft(
                monitor,
                source,
                "device",
                time * _MICRO,
                acc=acc,
                rate_hz=spec.rate_hz if spec and spec.rate_hz else _rate(tree.said(config, "Sample Rate")),
                segment=segment_named(tree.said(config, "Label 0")),
                gyr=gyr,
                mag=mag,
                quat=quat,
            )
        )
    return tuple(drafts)


def _rate(rate_text: str) -> float | None:
    try:
        rate = float(rate_text)
    except ValueError:
        return None
    return rate if 1.0 <= rate <= 10_000.0 else None
