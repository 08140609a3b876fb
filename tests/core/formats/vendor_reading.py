"""Files of vendors read as a recording, and what a refused one is told."""

from __future__ import annotations

import pytest

from sagittal.core.errors import InputError
from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.signals.recording import ImuStream, Recording


def read(data: bytes, name: str = "x.bin") -> Recording:
    """One file."""
    return read_recording([SourceFile.of_bytes(name, data)])


def only(recording: Recording) -> ImuStream:
    """The first sensor."""
    return next(iter(recording.streams.values()))


def code_of(data: bytes, name: str = "x.bin") -> str:
    """Code with which a file is refused, in a sentence."""
    with pytest.raises(InputError) as refused:
        read(data, name)
    assert len(refused.value.message.split()) > 6
    return refused.value.code


def read_parts(parts: dict[str, bytes]) -> Recording:
    """Files that belong together, by name."""
    return read_recording([SourceFile.of_bytes(name, data) for name, data in parts.items()])
