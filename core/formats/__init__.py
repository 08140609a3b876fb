"""Bytes → Recording: one vendor per file, detection by content, never by file name."""

from __future__ import annotations

from sagittal.core.formats.archive import ArchiveLimits, expand
from sagittal.core.formats.manifest import Manifest, manifest_of, parse_manifest
from sagittal.core.formats.parquet import write_recording
from sagittal.core.formats.reader import read_recording
from sagittal.core.formats.source import SourceFile, list_source_files, read_named_file

__all__ = [
    "ArchiveLimits",
    "Manifest",
    "SourceFile",
    "expand",
    "list_source_files",
    "manifest_of",
    "parse_manifest",
    "read_named_file",
    "read_recording",
    "write_recording",
]
