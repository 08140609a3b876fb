"""Zip and gzip expansion in memory, within limits checked against the actual bytes.

The directory of a zip may be false, so the declared sizes are checked before anything is unpacked and no
member may exceed its declared size. Limits: docs/reference/formats.md, "Limits" (entries, total, ratio 100,
no nesting, no absolute or parent paths, no links, no encryption).
"""

from __future__ import annotations

import io
import lzma
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Final

from sagittal.core.errors import ArchiveError, FormatError
from sagittal.core.formats.source import SourceFile
from sagittal.core.formats.tables.workbook import is_workbook, read_sheets

ZIP_MAGIC = (b"PK\x03\x04", b"PK\x05\x06", b"PK\x07\x08")
GZIP_MAGIC = b"\x1f\x8b"
_CHUNK = 1 << 20
_DAMAGE = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    EOFError,
    OSError,
    RuntimeError,
    ValueError,
    OverflowError,
)
"""What zipfile and zlib raise on damaged bytes (NotImplementedError is a RuntimeError)."""
EPISODE_MARK: Final = "sagittal-episode.json"
"""At the root of a zip: an archive of a visit; the recording lies in a folder, the rest came out of it."""
EPISODE_RECORDING: Final = "recording/"
EPISODE_MANIFEST: Final = "sagittal-manifest.json"
"""What the analysis was told beside the recording's own files, and goes before a manifest among these. An
archive that was analysed and archived again has that of every generation, the newest first."""
EPISODE_CONFIG: Final = "config.json"
_MOST_CONFIG: Final = 1_000_000
_SPREADSHEET: Final = {"mimetype", "content.xml", "META-INF/manifest.xml"}
_RATIO_FLOOR = 1 << 20
"""Below 1 MB no ratio is alarming: a file of a few blank lines packs 200 to 1."""


@dataclass(frozen=True)
class ArchiveLimits:
    """Limits of unpacked archives (docs/reference/formats.md, "Limits"; 1 GB holds 7 sensors × 4 h × 100 Hz
    as text).

    Parameters
    ----------
    entries : files and folders per zip.
    total : bytes unpacked, over all members.
    ratio : unpacked / packed, for files over 1 MB.
    """

    entries: int = 1000
    total: int = 1_000_000_000
    ratio: float = 100.0


def is_zip(head: bytes | bytearray) -> bool:
    """Whether the first four bytes are those of a zip."""
    return head[:4] in ZIP_MAGIC


def is_gzip(head: bytes | bytearray) -> bool:
    """Whether the first two bytes are those of a gzip."""
    return head[:2] == GZIP_MAGIC


def expand(files: Iterable[SourceFile], limits: ArchiveLimits | None = None) -> list[SourceFile]:
    """Replace every zip by its members and every gzip by its content; other files are passed through unread.

    A workbook is replaced by its sheets as text.

    Raises
    ------
    ArchiveError
        zip_bomb, zip_traversal, zip_link, zip_nested, zip_encrypted, zip_bad.
    FormatError
        reader_missing, bad_workbook.
    """
    limits = limits or ArchiveLimits()
    out: list[SourceFile] = []
    used_names: set[str] = set()
    for file in files:
        if not _looks_packed(file):
            members = [file]
        else:
            with file.open() as opened:
                head = opened.read(4)
            if is_zip(head):
                members = _members(file.name, file.read(), limits)
            elif is_gzip(head):
                members = [_unpacked(file.name, file.read(), limits)]
            else:
                members = [file]
        for m in members:
            name = m.name if m.name not in used_names else f"{file.name}/{m.name}"
            used_names.add(name)
            out.append(m if name == m.name else SourceFile(name, m.size, m.read, m.opener))
    return out


def _is_workbook_name(name: str) -> bool:
    return name.lower().endswith((".xlsx", ".xlsm")) and not PurePosixPath(name).name.startswith(("~$", "._"))


def _looks_packed(file: SourceFile) -> bool:
    """Whether a file must be inspected: content decides, only unambiguous names avoid the read."""
    return not file.name.lower().endswith((".txt", ".csv", ".tsv", ".json", ".parquet", ".xml", ".md"))


def _members(name: str, data: bytes, limits: ArchiveLimits) -> list[SourceFile]:
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except _DAMAGE as e:
        raise ArchiveError("zip_bad", f"{name} is damaged and cannot be opened ({e}); zip it again.") from e
    infos = archive.infolist()
    if len(infos) > limits.entries:
        raise ArchiveError(
            "zip_bomb",
            f"{name} has {len(infos)} entries, at most {limits.entries} are accepted; "
            "upload one session per zip.",
        )
    total = sum(i.file_size for i in infos)
    if total > limits.total:
        raise ArchiveError(
            "zip_bomb",
            f"{name} unpacks to {total / 1e6:.0f} MB, at most {limits.total / 1e6:.0f} MB are accepted; "
            "upload fewer files at once.",
        )
    for info in infos:
        _check_entry(name, info, limits)
    members = [
        SourceFile(info.filename, info.file_size, _MemberReader(name, archive, info))
        for info in infos
        if not info.is_dir() and "__MACOSX" not in PurePosixPath(info.filename).parts
    ]
    names = {f.name for f in members}
    if is_workbook(names):
        return read_sheets(name, data)
    if names >= _SPREADSHEET:
        raise FormatError(
            "unsupported_format", f"{name} is an OpenDocument spreadsheet; save it as .xlsx or CSV."
        )
    members = [
        inner
        for f in members
        for inner in (_members(f.name, f.read(), limits) if _is_workbook_name(f.name) else [f])
    ]
    if EPISODE_MARK not in names:
        return members
    manifests = [f for f in members if f.name == EPISODE_MANIFEST]
    return manifests + [
        SourceFile(f.name.removeprefix(EPISODE_RECORDING), f.size, f.read, f.opener)
        for f in members
        if f.name.startswith(EPISODE_RECORDING)
    ]


def read_episode_config(files: Iterable[SourceFile]) -> bytes | None:
    """Analysis settings from the archive of a visit, as JSON; None without an archive.

    Raises
    ------
    ArchiveError as `expand`.
    """
    for file in files:
        if not _looks_packed(file):
            continue
        with file.open() as opened:
            if not is_zip(opened.read(4)):
                continue
            opened.seek(0)
            try:
                archive = zipfile.ZipFile(opened)
                if EPISODE_MARK not in archive.namelist():
                    continue
                info = archive.getinfo(EPISODE_CONFIG)
            except (*_DAMAGE, KeyError) as e:
                raise ArchiveError(
                    "zip_bad", f"{file.name} is damaged and cannot be opened ({e}); zip it again."
                ) from e
            if info.file_size > _MOST_CONFIG:
                raise ArchiveError(
                    "zip_bomb", f"{file.name}: its {EPISODE_CONFIG} is larger than settings are."
                )
            return _MemberReader(file.name, archive, info)()
    return None


def _check_entry(name: str, info: zipfile.ZipInfo, limits: ArchiveLimits) -> None:
    path = info.filename.replace("\\", "/")
    if path.startswith("/") or path[1:2] == ":" or ".." in path.split("/") or "\0" in info.orig_filename:
        raise ArchiveError(
            "zip_traversal",
            f"{name} contains the path '{info.filename}', which leads out of it; zip the files again.",
        )
    if stat.S_ISLNK(info.external_attr >> 16):
        raise ArchiveError(
            "zip_link", f"{name} contains the link '{info.filename}'; zip the file itself instead of a link."
        )
    if info.flag_bits & 0x1:
        raise ArchiveError("zip_encrypted", f"{name} is protected by a password; zip it without one.")
    _check_ratio(name, info.file_size, info.compress_size, limits)


def _check_ratio(name: str, unpacked: int, packed: int, limits: ArchiveLimits) -> None:
    if unpacked > _RATIO_FLOOR and unpacked > limits.ratio * max(packed, 1):
        raise ArchiveError(
            "zip_bomb",
            f"{name} unpacks to {unpacked / max(packed, 1):.0f} times its size, at most "
            f"{limits.ratio:.0f} times is accepted; recordings pack 3 to 10 times, so this is not one.",
        )


@dataclass(frozen=True, eq=False)
class _MemberReader:
    """Unpacks one member; rejects more bytes than its directory entry declared."""

    name: str
    archive: zipfile.ZipFile
    info: zipfile.ZipInfo

    def __call__(self) -> bytes:
        label = f"{self.name}, member '{self.info.filename}'"
        out = bytearray()
        try:
            with self.archive.open(self.info) as stream:
                while chunk := stream.read(_CHUNK):
                    out += chunk
                    if len(out) > self.info.file_size:
                        raise ArchiveError(
                            "zip_bomb", f"{label}: more bytes than declared; zip the files again."
                        )
        except _DAMAGE as e:
            raise ArchiveError("zip_bad", f"{label} is damaged ({e}); zip the files again.") from e
        if len(out) != self.info.file_size:
            raise ArchiveError("zip_bad", f"{label} ends early; zip the files again.")
        if (is_zip(out[:4]) and not _is_workbook_name(self.info.filename)) or is_gzip(out[:2]):
            raise ArchiveError(
                "zip_nested", f"{label} is an archive itself; put the recordings directly into one zip."
            )
        return bytes(out)


def _unpacked(name: str, data: bytes, limits: ArchiveLimits) -> SourceFile:
    """Unpack a gzip with all its members, counting the output."""
    out = bytearray()
    remaining = data
    try:
        while is_gzip(remaining):
            stream = zlib.decompressobj(wbits=31)
            while not stream.eof:
                previous_size = len(out)
                out += stream.decompress(remaining, _CHUNK)
                remaining = stream.unconsumed_tail
                if len(out) > limits.total:
                    raise ArchiveError(
                        "zip_bomb",
                        f"{name} unpacks to more than {limits.total / 1e6:.0f} MB; upload it in parts.",
                    )
                _check_ratio(name, len(out), len(data), limits)
                if len(out) == previous_size and not remaining and not stream.eof:
                    raise ArchiveError("zip_bad", f"{name} ends in the middle; upload it again.")
            remaining = stream.unused_data
    except zlib.error as e:
        raise ArchiveError("zip_bad", f"{name} is damaged ({e}); upload it again.") from e
    if is_zip(out[:4]) or is_gzip(out[:2]):
        raise ArchiveError(
            "zip_nested", f"{name} is an archive inside an archive; upload the files themselves."
        )
    path = PurePosixPath(name)
    plain = path.with_suffix("") if path.suffix.lower() == ".gz" else path
    return SourceFile.of_bytes(str(plain), bytes(out))
