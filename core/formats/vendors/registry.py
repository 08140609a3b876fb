"""Self-describing sensor formats that need no manifest: one entry each, detected by content."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from sagittal.core.formats.draft import Draft
from sagittal.core.formats.source_spec import SourceSpec
from sagittal.core.formats.vendors import apdm, apdm_h5, cwa, device_motion, dot, mvnx, shimmer, xsens


@dataclass(frozen=True)
class VendorFormat:
    """A reader for one format.

    Parameters
    ----------
    label : display name. looks_like : detects a file by its bytes, never by its name; text is passed as
        UTF-8. read : bytes, name of the file, its manifest entry → its sensors in SI units; raises
        FormatError. one_sensor : a file contains one sensor of a recording, the others are in separate files.
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
    """The format of a file, None if no entry matches."""
    return next((vendor for vendor in VENDOR_FORMATS if vendor.looks_like(data)), None)


def list_formats() -> str:
    """All supported formats as a list for messages about unreadable uploads."""
    labels = (vendor.label for vendor in VENDOR_FORMATS)
    return ", ".join(
        (*labels, "BIDS motion", "CSV or TSV with a manifest", "Sagittal Parquet", "Sagittal live log")
    )
