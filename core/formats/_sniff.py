"""File type detection by content, never by name."""

from __future__ import annotations

import json
from typing import Final, Literal

from sagittal.core.formats import live_reader, parquet, text
from sagittal.core.formats.manifest import is_manifest
from sagittal.core.formats.tables.layout import LINES, find_layout
from sagittal.core.formats.vendors import mapping_xml
from sagittal.core.formats.vendors.registry import find_vendor

Kind = Literal["vendor", "parquet", "live", "manifest", "mapping", "table", "known", "empty", "other"]
"""vendor = of `VENDOR_FORMATS`; known = a sensor format we recognise but do not read; other = neither signals
nor manifest."""

_MAGIC: Final = {
    b"\x89HDF": "HDF5 that is not APDM's (MATLAB 7.3, …)",
    b"MATLAB": "MATLAB",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook (.xls)",
    b"XTF\x00": "Xsens MTB",
    b"\xfa\xff": "Xsens MTB",
}
_TEXT: Final = {
    b"DataType=Quaternion": "OpenSim STO",
    b"inDegrees=": "OpenSim MOT",
}
_ADVICE: Final = {
    "an old Excel workbook (.xls)": "save it as .xlsx or CSV.",
    "OpenSim STO": "orientations alone are no measurement. Upload the sensors' files; "
    "compare orientations on the tab Algorithms of an analysed session.",
    "OpenSim MOT": "joint angles alone are no measurement. Upload the sensors' files.",
    "Xsens MTB": "export it from MT Manager as text, with acceleration and rate of turn.",
}
_TABLE: Final = (
    "it is not read directly; export it as a table and name its columns in a manifest "
    "(docs/reference/formats.md)."
)


def advise(format_name: str) -> str:
    """Advice for a recognised format that is not supported."""
    return _ADVICE.get(format_name, _TABLE)


def sniff(data: bytes) -> tuple[Kind, str]:
    """File kind and its display name.

    Parameters
    ----------
    data : all bytes, after unpacking; text already as UTF-8.
    """
    if not data or data.isspace():
        return "empty", "an empty file"
    if parquet.looks_like(data):
        return "parquet", "Parquet"
    if live_reader.looks_like(data):
        return "live", "a live take"
    vendor = find_vendor(data)
    if vendor is not None:
        return "vendor", vendor.label
    for magic, name in _MAGIC.items():
        if data.startswith(magic):
            return "known", name
    if not text.is_text(data):
        return "other", "a binary file"
    if data.lstrip()[:1] in (b"{", b"["):
        return _sniff_json(data)
    if mapping_xml.looks_like(data):
        return "mapping", "OpenSense mapping"
    head = data[:4096]
    for mark, name in _TEXT.items():
        if mark in head:
            return "known", name
    return ("table", "a table of numbers") if _is_table(data) else ("other", "a text")


def _sniff_json(data: bytes) -> tuple[Kind, str]:
    # told apart by what it says, however badly: a manifest with a mistake is refused as one, by name
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        return "other", "a damaged JSON file"
    return ("manifest", "a manifest") if is_manifest(value) else ("other", "a JSON file")


def _is_table(data: bytes) -> bool:
    """Tell a table by two neighbouring rows of as many numbers."""
    return find_layout(text.head_lines(data, LINES)) is not None
