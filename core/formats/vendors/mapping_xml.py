"""OpenSense mapping files (XsensDataReaderSettings): assignment of sensors to segments."""

from __future__ import annotations

from xml.etree.ElementTree import ParseError

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import fromstring

from sagittal.core.errors import FormatError
from sagittal.core.formats.aliases import segment_named
from sagittal.core.frames import Segment


def looks_like(data: bytes) -> bool:
    """Whether the data have the element names of an OpenSense mapping."""
    return data.lstrip()[:1] == b"<" and b"<ExperimentalSensor " in data


def read(data: bytes, source: str) -> dict[str, Segment | None]:
    """Sensor id → segment; unsupported bodies (hands) map to None.

    Raises
    ------
    FormatError bad_xml (not well formed, or with entities, which are rejected).
    """
    try:
        root = fromstring(data, forbid_dtd=True)
    except (ParseError, DefusedXmlException, ValueError, LookupError) as e:  # LookupError: of its encoding
        raise FormatError(
            "bad_xml", f"{source} is not readable XML ({type(e).__name__}); export it again."
        ) from e
    out: dict[str, Segment | None] = {}
    for sensor in root.iter("ExperimentalSensor"):
        device = (sensor.get("name") or "").strip().lstrip("_")
        if device:
            out[device.upper()] = segment_named((sensor.findtext("name_in_model") or "").strip())
    return out
