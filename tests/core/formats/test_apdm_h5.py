"""APDM as HDF5: what is read of it, and what a file may not lead to."""

from __future__ import annotations

import sys

import pytest

from core.errors import FormatError
from core.formats import apdm_h5
from core.formats.source_spec import SourceSpec
from tests.core.formats import vendor_files as made
from tests.core.formats.vendor_reading import read


@pytest.fixture(scope="module", autouse=True)
def with_h5py() -> None:
    pytest.importorskip("h5py")


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


def test_signals_of_another_shape_are_refused() -> None:
    import io

    import h5py

    def changed(name: str, value: object) -> bytes:
        out = io.BytesIO(made.apdm_h5())
        with h5py.File(out, "r+") as file:
            del file[name]
            if value is not None:
                file[name] = value
        return out.getvalue()

    sensor = "Sensors/1234"
    assert code_of(changed(f"{sensor}/Accelerometer", made.ACC[:, :2])) == "bad_hdf5"
    assert code_of(changed(f"{sensor}/Time", None)) == "missing_acc"
    assert code_of(changed(f"{sensor}/Time", made.T[:-1])) == "missing_acc"
    assert code_of(changed("Sensors", None)) == "empty"
    # a signal that is shorter than the acceleration is left out
    (first, _) = apdm_h5.read(changed(f"{sensor}/Magnetometer", made.MAG[:-1]), "opal.h5")
    assert first.mag is None
    assert first.gyr is not None
