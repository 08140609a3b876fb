"""Sensor formats that say everything themselves and need no manifest: one entry each, found by content."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from sagittal.core.formats.draft import Draft
from sagittal.core.formats.source_spec import SourceSpec
from sagittal.core.formats.vendors import apdm, apdm_h5, cwa, device_motion, dot, mvnx, shimmer, xsens


@dataclass(frozen=True)
class VendorFormat:
    """A reader of one format.

    Parameters
    ----------
    label : name for people. looks_like : tells a file by its bytes, never by its name; text comes as UTF-8.
    read : bytes, name of the file, what a manifest says of it → its sensors in SI units; raises FormatError.
    one_sensor : a file holds one sensor of a take, the others are in files beside it.
    """

    label: str
    looks_like: Callable[[bytes], bool]
    read: Callable[[bytes, str, SourceSpec | None], Sequence[Draft]]
    one_sensor: bool = False


VENDOR_FORMATS: Final[list[VendorFormat]] = [
    VendorFormat(
        "Xsens MT Manager text",
        xsens.looks_like,
        lambda data, name, spec: (xsens.read(data, name, spec),),
        True,
    ),
    VendorFormat(mvnx.LABEL, mvnx.looks_like, mvnx.read),
    VendorFormat(dot.LABEL, dot.looks_like, dot.read, one_sensor=True),
    VendorFormat(apdm.LABEL, apdm.looks_like, apdm.read),
    VendorFormat(apdm_h5.LABEL, apdm_h5.looks_like, apdm_h5.read),
    VendorFormat(shimmer.LABEL, shimmer.looks_like, shimmer.read, one_sensor=True),
    VendorFormat(cwa.LABEL, cwa.looks_like, cwa.read),
    VendorFormat(device_motion.LABEL, device_motion.looks_like, device_motion.read),
]
"""All of them, in the order in which they are tried (docs/how-to/contributing.md, "Add a reader")."""


def find_vendor(data: bytes) -> VendorFormat | None:
    """The format of a file, None where no entry knows it."""
    return next((vendor for vendor in VENDOR_FORMATS if vendor.looks_like(data)), None)


def list_formats() -> str:
    """Everything that is read, as a sentence about an unreadable upload lists it."""
    labels = (vendor.label for vendor in VENDOR_FORMATS)
    return ", ".join(
        (*labels, "BIDS motion", "CSV or TSV with a manifest", "Sagittal Parquet", "Sagittal live log")
    )
