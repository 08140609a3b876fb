"""Export formats: names, required files and writers."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Final, Literal, get_args

from sagittal.core.errors import InputError
from sagittal.server.export.content import POSES, ExportContent
from sagittal.server.report.files import signals

ExportName = Literal["xlsx", "csv", "opensim", "c3d", "bids", "fhir", "walk"]


@dataclass(frozen=True)
class ExportKind:
    """One format.

    Parameters
    ----------
    ending : file extension. label : display name. what : content and purpose.
    needs : required result files. hands_on_signed : includes the signed report.
    """

    name: ExportName
    ending: str
    label: str
    what: str
    needs: tuple[str, ...] = ()
    hands_on_signed: bool = False


KINDS: Final[tuple[ExportKind, ...]] = (
    ExportKind(
        "xlsx", "xlsx", "Excel workbook", "Values, strides, mean curves, contacts, notices, data dictionary"
    ),
    ExportKind(
        "csv",
        "zip",
        "Tables for statistics",
        "One row per stride and value as CSV, the same wide, and a data dictionary",
    ),
    ExportKind(
        "opensim",
        "zip",
        "OpenSim",
        "Joint angles as .mot, orientations of the sensors for OpenSense as .sto",
        ("angles.parquet",),
    ),
    ExportKind(
        "c3d", "zip", "C3D", "Joint centres, joint angles and contacts for motion-capture programs", (POSES,)
    ),
    ExportKind(
        "bids",
        "zip",
        "BIDS data set",
        "Sensor signals, contacts and strides as BIDS-motion, without dates",
        (signals.NAME,),
    ),
    ExportKind(
        "fhir",
        "json",
        "FHIR bundle",
        "All values and the signed report for a hospital system, FHIR R4; preliminary until signed",
        hands_on_signed=True,
    ),
    ExportKind(
        "walk",
        "html",
        "3D walk",
        "The animated avatar as a single page that opens without a server",
        (POSES,),
    ),
)
"""In display order."""

EXPORTED: Final = "export-"
"""Prefix of an export's name among the files of its analysis."""

NAMES: Final[tuple[str, ...]] = get_args(ExportName)


def find_kind(name: str) -> ExportKind:
    """Find a format by name; raises InputError `unknown_export`."""
    for kind in KINDS:
        if kind.name == name:
            return kind
    raise InputError("unknown_export", f"'{name}' is no export; choose one of {', '.join(NAMES)}.")


def name_file(kind: ExportKind, job_id: str) -> str:
    """File name of an export within its analysis, from the id of its job."""
    return f"{EXPORTED}{kind.name}-{job_id[:8]}.{kind.ending}"


def list_possible(files: Collection[str]) -> tuple[ExportKind, ...]:
    """Formats that can be written from an analysis with these result files."""
    return tuple(kind for kind in KINDS if all(name in files for name in kind.needs))


DRAWN: Final[dict[str, Callable[[ExportContent], bytes]]] = {}
"""Formats written by a higher-level package, by name, which registers its writer."""


def write_export(name: str, content: ExportContent) -> bytes:
    """Write one format; raises InputError `unknown_export`, or SagittalError if it cannot be written."""
    match find_kind(name).name:
        case "xlsx":
            from sagittal.server.export.workbook import write_workbook

            return write_workbook(content)
        case "csv":
            from sagittal.server.export.tidy import write_tidy

            return write_tidy(content)
        case "opensim":
            from sagittal.server.export.opensim import write_opensim

            return write_opensim(content)
        case "c3d":
            from sagittal.server.export.c3d import write_c3d

            return write_c3d(content)
        case "bids":
            from sagittal.server.export.bids import write_bids

            return write_bids(content)
        case "fhir":
            from sagittal.server.export.fhir import write_fhir

            return write_fhir(content)
        case drawn:
            return DRAWN[drawn](content)
