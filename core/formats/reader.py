"""The one door: files of an upload → Recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from core.errors import ArchiveError, FormatError, InputError, ManifestError, Notice
from core.formats import _sniff, live_reader, mapping_xml, parquet, table, text
from core.formats.aliases import segment_named
from core.formats.archive import ArchiveLimits, expand
from core.formats.draft import Draft, finish
from core.formats.manifest import Manifest, parse_manifest
from core.formats.source import SourceFile, sha256
from core.formats.vendors import find_vendor, list_formats
from core.frames import Segment
from core.recording import Recording

_SHOWN = 5


@dataclass
class _Upload:
    """What has been found so far."""

    drafts: list[Draft] = field(default_factory=list)
    stored: list[Recording] = field(default_factory=list)
    manifests: list[tuple[str, bytes]] = field(default_factory=list)
    mapping: dict[str, Segment | None] = field(default_factory=dict)
    problems: list[tuple[str, InputError]] = field(default_factory=list)
    notices: list[Notice] = field(default_factory=list)
    sha256: dict[str, str] = field(default_factory=dict)


def read_recording(
    files: Sequence[SourceFile], manifest: Manifest | None = None, limits: ArchiveLimits | None = None
) -> Recording:
    """Read one take from its files, whatever their format.

    Parameters
    ----------
    files : sensor files, archives of them, optionally a manifest or an OpenSense mapping among them.
    manifest : wins over a manifest among the files, which completes what it leaves open.
    limits : of archives.

    Raises
    ------
    ArchiveError
        An archive breaks a limit or is damaged (codes in `core.formats.archive`).
    FormatError
        unknown_format when nothing could be read (with what was tried), or the problem of the only file;
        duplicate_device, counter_restart.
    ManifestError
        The manifest is wrong or does not fit a file.
    """
    members = expand(files, limits)
    if not members:
        raise FormatError("empty", "There are no files; choose the recording's files, folder or zip.")
    upload = _Upload()
    manifest = _find_manifest(members, manifest, upload)
    for member in members:
        _take(member, manifest, upload)
    if not upload.drafts and not upload.stored:
        raise _nothing_readable(upload)
    recording = _stored(upload) if upload.stored else Recording(finish(upload.drafts), segments={})
    return _declared(recording, manifest, upload)


def _find_manifest(members: Sequence[SourceFile], given: Manifest | None, upload: _Upload) -> Manifest | None:
    """The manifest has to be known before tables can be read."""
    for member in members:
        last = member.name.rsplit("/", 1)[-1].lower()
        if last.endswith(".json") and member.size < 1_000_000:
            data = text.to_utf8(member.read())
            if last == "manifest.json" or _sniff.sniff(data)[0] == "manifest":
                upload.manifests.append((member.name, data))
    if len(upload.manifests) > 1:
        names = " and ".join(n for n, _ in upload.manifests)
        raise ManifestError("manifest_twice", f"There are several manifests ({names}); keep one.")
    if not upload.manifests:
        return given
    found = parse_manifest(upload.manifests[0][1])
    return found if given is None else given.complete_from(found)


def _take(member: SourceFile, manifest: Manifest | None, upload: _Upload) -> None:
    """Read one file; a file that cannot be read is remembered, it does not stop the others."""
    raw = member.read()
    data = raw if parquet.looks_like(raw) or live_reader.looks_like(raw) else text.to_utf8(raw)
    spec = manifest.source_of(member.name) if manifest else None
    kind, what = _sniff.sniff(data)
    if any(member.name == name for name, _ in upload.manifests):
        upload.sha256[member.name] = sha256(raw)
        return
    try:
        vendor = find_vendor(data) if kind == "vendor" else None
        if vendor is not None and not (spec and spec.columns):
            upload.drafts += vendor.read(data, member.name, spec)
        elif kind == "parquet":
            upload.stored.append(parquet.read_recording(data, member.name))
        elif kind == "live":
            upload.stored.append(live_reader.read_live_log(data, member.name))
        elif kind == "mapping":
            upload.mapping |= mapping_xml.read(data, member.name)
        elif spec and spec.columns and kind != "empty" and text.is_text(data):
            upload.drafts += table.read_table(data, member.name, spec)
        elif kind == "empty":
            raise FormatError("empty", f"{member.name} is empty; copy or export it again.")
        elif kind == "table":
            raise FormatError("manifest_needed", _needs_manifest(member.name, data))
        elif kind == "known":
            raise FormatError(
                "unsupported_format",
                f"{member.name} is {what}, which is not read directly; export it as a table and name its "
                "columns in a manifest (docs/formats.md).",
            )
        else:
            message = f"{member.name} is {what} and was not used."
            upload.notices.append(Notice("ignored_file", message, severity="info"))
            return
        upload.sha256[member.name] = sha256(raw)
    except (ArchiveError, ManifestError):
        raise
    except FormatError as e:
        upload.problems.append((member.name, e))


def _needs_manifest(name: str, data: bytes) -> str:
    lines = text.head_lines(data, 2)
    start = lines[0][:80].decode("utf-8", errors="replace")
    return (
        f"{name} is a table that starts with '{start}'; say in a manifest which columns are which sensor "
        "and their units (docs/formats.md)."
    )


def _nothing_readable(upload: _Upload) -> FormatError:
    if len(upload.problems) == 1:
        error = upload.problems[0][1]
        return FormatError(error.code, error.message, sensor=error.sensor, t_s=error.t_s)
    codes = {e.code for _, e in upload.problems}
    lines = [e.message for _, e in upload.problems] + [n.message for n in upload.notices]
    shown = " ".join(lines[:_SHOWN]) + (f" … and {len(lines) - _SHOWN} more." if len(lines) > _SHOWN else "")
    code = codes.pop() if len(codes) == 1 and len(upload.problems) == len(lines) else "unknown_format"
    return FormatError(code, f"No sensor recording was found; tried {list_formats()}. {shown}")


def _stored(upload: _Upload) -> Recording:
    """A stored recording is a whole take: it cannot be mixed with other files."""
    if len(upload.stored) > 1 or upload.drafts:
        raise FormatError(
            "several_recordings",
            f"{len(upload.stored)} stored recordings and {len(upload.drafts)} other sensor files were given; "
            "a Parquet recording or a live log is a whole take, upload it alone.",
        )
    return upload.stored[0]


def _declared(recording: Recording, manifest: Manifest | None, upload: _Upload) -> Recording:
    """Add what the manifest, the mapping file or the column names say."""
    notices = [*recording.notices, *upload.notices]
    notices += [
        Notice(
            "file_not_read" if e.code != "missing_acc" else e.code,
            f"{e.message} The other sensors were read.",
            e.sensor,
        )
        for _, e in upload.problems
    ]
    segments = dict(recording.segments)
    if manifest is not None and manifest.sensors:
        segments, missing = _assign(manifest.sensors, recording, "manifest")
        notices += missing
    elif upload.mapping:
        segments, missing = _assign(upload.mapping, recording, "mapping file")
        notices += missing
    taken = {s for s in segments.values() if s is not None}
    for device in recording.streams:
        own = segment_named(device) if manifest and manifest.sources and not manifest.sensors else None
        if own is not None and device not in segments and own not in taken:
            segments[device] = own
            taken.add(own)
    return replace(
        recording,
        segments=segments,
        subject=manifest.subject.complete_from(recording.subject) if manifest else recording.subject,
        protocol=(manifest.protocol if manifest else None) or recording.protocol,
        belt_speed_mps=(manifest.belt_speed_mps if manifest else None) or recording.belt_speed_mps,
        mounting={**recording.mounting, **(manifest.mounting if manifest else {})},
        sha256={**recording.sha256, **upload.sha256},
        notices=tuple(notices),
    )


def _assign(
    declared: Mapping[str, Segment | None], recording: Recording, by: str
) -> tuple[dict[str, Segment | None], list[Notice]]:
    """Match declared ids to streams without regard to case; a declared sensor without a file is said."""
    ids = {d.lower(): d for d in recording.streams}
    segments: dict[str, Segment | None] = {}
    missing: list[Notice] = []
    for device, segment in declared.items():
        found = ids.get(device.lower())
        if found is not None:
            segments[found] = segment
        elif segment is not None:
            missing.append(
                Notice(
                    "sensor_missing",
                    f"The {by} puts sensor {device} on {segment}, but no file holds it (found: "
                    f"{', '.join(recording.streams)}); results that need {segment} are left out.",
                    device,
                )
            )
    return segments, missing
