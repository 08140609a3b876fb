"""Grouping of the files of a folder into recordings: a study has many, in any folder layout.

A file with all sensors (a zip, a stored recording, APDM, MVNX, CWA, a phone) is one recording. BIDS motion
files are grouped by subject, session, task and run, regardless of the tracking system. Other files of a
folder are grouped by their names without the last part, if that leaves several in each group ("11-1_lf.txt",
"11-1_rf.txt"); otherwise the folder is one recording. An OpenSense mapping applies to every recording of its
folder, and so does the manifest of the folder or of the nearest parent.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sagittal.core.formats import _sniff, bids, live_reader, parquet, text
from sagittal.core.formats.archive import is_gzip, is_zip
from sagittal.core.formats.vendors import mapping_xml
from sagittal.core.formats.vendors.registry import find_vendor

MANIFEST: Final = "manifest.json"
_HEAD: Final = 1 << 16
_LAST_PART: Final = re.compile(r"[_\-\s][^_\-\s]*$")
_ENDINGS: Final = re.compile(r"(\.(txt|csv|tsv|gz))+$", re.IGNORECASE)
_ENTITY: Final = re.compile(r"(sub|ses|task|run|acq)-([^_]+)")


@dataclass(frozen=True)
class FoundTake:
    """Files of one recording.

    Parameters
    ----------
    name : unique within the folder, with forward slashes. paths : signal and description files. labels :
        entities of BIDS names: sub, ses, task, run, acq.
    """

    name: str
    paths: tuple[Path, ...]
    labels: Mapping[str, str]


def find_takes(root: Path) -> list[FoundTake]:
    """Recordings in a folder and its subfolders, by name; files without signals are omitted."""
    folders: dict[Path, list[Path]] = {}
    for path in sorted(p for p in root.rglob("*") if p.is_file()):
        if not any(part.startswith(".") for part in path.relative_to(root).parts):
            folders.setdefault(path.parent, []).append(path)
    takes: list[FoundTake] = []
    for folder, paths in folders.items():
        takes += _of_folder(root, folder, paths)
    return sorted(takes, key=lambda take: take.name)


def _of_folder(root: Path, folder: Path, paths: Sequence[Path]) -> list[FoundTake]:
    kinds = {path: _kind_of(path) for path in paths}
    groups: dict[str, list[Path]] = {}
    loose: list[Path] = []
    for path in paths:
        if bids.is_table(path.name):
            groups.setdefault(
                re.sub(r"_tracksys-[^_]+", "", path.name).removesuffix("_motion.tsv"), []
            ).append(path)
        elif kinds[path] == "take":
            groups.setdefault(path.name, []).append(path)
        elif kinds[path] == "sensor":
            loose.append(path)
    for name, own in _by_name(loose).items():
        groups.setdefault(name, []).extend(own)
    mappings = [p for p in paths if kinds[p] == "mapping"]
    takes = []
    for name, own in groups.items():
        sidecars = [part for p in own if bids.is_table(p.name) for part in bids.find_parts(p.name)]
        parts = [*own, *mappings, *(p for p in paths if p.name in sidecars)]
        manifest = _manifest_of(root, folder)
        if manifest is not None and not any(is_zip(_head(p)) for p in own):
            parts.append(manifest)
        folder_name = folder.relative_to(root).as_posix()
        full = "/".join(part for part in ("" if folder_name == "." else folder_name, name) if part)
        takes.append(FoundTake(full or root.name, tuple(parts), dict(_ENTITY.findall(name))))
    return takes


def _by_name(paths: Sequence[Path]) -> dict[str, list[Path]]:
    """Single-sensor files by the common part of their names; all of them, named "", if that is not
    informative.
    """
    groups: dict[str, list[Path]] = {}
    for path in paths:
        groups.setdefault(_LAST_PART.sub("", _ENDINGS.sub("", path.name)), []).append(path)
    if len(groups) > 1 and all(len(g) > 1 for g in groups.values()):
        return groups
    return {"": list(paths)} if paths else {}


def _manifest_of(root: Path, folder: Path) -> Path | None:
    """The manifest of a folder, or of the nearest parent within the study."""
    for ancestor in (folder, *folder.parents):
        if (manifest := ancestor / MANIFEST).is_file():
            return manifest
        if ancestor == root:
            break
    return None


def _head(path: Path) -> bytes:
    with path.open("rb") as opened:
        return opened.read(_HEAD)


def _kind_of(path: Path) -> str:
    """Kind of a file: "take" (all sensors in one file), "sensor" (one of several), "mapping", or "" for
    others.
    """
    head = _head(path)
    if is_zip(head) or head.startswith(parquet.MAGIC) or live_reader.looks_like(head):
        return "take"
    if is_gzip(head):
        return "sensor"
    data = text.to_utf8(head)
    vendor = find_vendor(data)
    if vendor is not None:
        return "sensor" if vendor.one_sensor else "take"
    if mapping_xml.looks_like(data):
        return "mapping"
    return "sensor" if _sniff.sniff(data)[0] == "table" and not bids.looks_like(data) else ""
