"""APDM as HDF5: what is read of it, and what a file may not lead to."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sagittal.core.errors import FormatError
from sagittal.core.formats.source_spec import SourceSpec
from sagittal.core.formats.vendors import apdm_h5
from tests.core.formats import vendor_files as made
from tests.core.formats.vendor_reading import read

h5py = pytest.importorskip("h5py")


def code_of(data: bytes) -> str:
    with pytest.raises(FormatError) as refused:
        apdm_h5.read(data, "opal.h5")
    return refused.value.code


def test_files_of_another_version_or_with_links_are_refused() -> None:
    assert code_of(made.apdm_h5(version=3)) == "unsupported_format"
    assert code_of(made.apdm_h5(link=True)) == "bad_hdf5"


def test_without_h5py_the_answer_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    data = made.apdm_h5()
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(FormatError, match="sagittal\\[apdm\\]") as refused:
        read(data)
    assert refused.value.code == "reader_missing"


def test_every_monitor_is_read_with_its_rate_and_place() -> None:
    drafts = apdm_h5.read(made.apdm_h5(), "opal.h5")
    assert [(d.device_id, d.segment, d.rate_hz) for d in drafts] == [
        ("1234", "pelvis", 100.0),
        ("1235", "foot_r", 100.0),
    ]
    (first, _) = apdm_h5.read(made.apdm_h5(), "opal.h5", SourceSpec(file="opal.h5", rate_hz=64.0))
    assert first.rate_hz == 64.0


def test_damaged_files_and_other_ones_are_not_taken() -> None:
    whole = made.apdm_h5()
    assert apdm_h5.looks_like(whole)
    assert not apdm_h5.looks_like(whole[1:])
    assert not apdm_h5.looks_like(whole.replace(b"Accelerometer", b"Accelerograph"))
    assert code_of(whole[: len(whole) // 2]) == "bad_hdf5"


def changed(name: str, put: Callable[[Any], object]) -> bytes:
    """The file with something else at a place: what `put` gives for the open file, None for nothing."""
    out = io.BytesIO(made.apdm_h5())
    with h5py.File(out, "r+") as file:
        value = put(file)
        del file[name]
        if value is not None:
            file[name] = value
    return out.getvalue()


def test_signals_of_another_shape_are_refused() -> None:
    acc, time, mag = (f"Sensors/1234/{x}" for x in ("Accelerometer", "Time", "Magnetometer"))
    assert code_of(changed(acc, lambda _: made.ACC[:, :2])) == "bad_hdf5"
    assert code_of(changed(time, lambda _: None)) == "missing_acc"
    assert code_of(changed(time, lambda _: made.T[:-1])) == "missing_acc"
    assert code_of(changed("Sensors", lambda _: None)) == "empty"
    # a signal that is shorter than the acceleration is left out
    (first, _) = apdm_h5.read(changed(mag, lambda _: made.MAG[:-1]), "opal.h5")
    assert first.mag is None
    assert first.gyr is not None


def test_nothing_is_read_from_where_a_link_leads(tmp_path: Path) -> None:
    """Not even where it leads to good samples."""
    other = tmp_path / "other.h5"
    other.write_bytes(made.apdm_h5())
    acc = "Sensors/1234/Accelerometer"
    for link in (
        h5py.SoftLink("/Sensors/1235/Accelerometer"),
        h5py.ExternalLink(str(other), "/Sensors/1235/Accelerometer"),
    ):
        with pytest.raises(FormatError, match="Accelerometer is a link") as refused:
            apdm_h5.read(changed(acc, lambda _, link=link: link), "opal.h5")  # type: ignore[misc]
        assert refused.value.code == "bad_hdf5"


def test_nothing_is_read_that_is_kept_in_another_file(tmp_path: Path) -> None:
    other = tmp_path / "other.h5"
    other.write_bytes(made.apdm_h5())
    shape = made.ACC.shape
    out = io.BytesIO(made.apdm_h5())
    with h5py.File(out, "r+") as file:
        at = file["Sensors/1234"]
        del at["Accelerometer"]
        layout = h5py.VirtualLayout(shape, np.float32)
        layout[:] = h5py.VirtualSource(str(other), "Sensors/1235/Accelerometer", shape)
        at.create_virtual_dataset("Accelerometer", layout)
    with pytest.raises(FormatError, match="Accelerometer lies in another file"):
        apdm_h5.read(out.getvalue(), "opal.h5")
