"""The single entry point: uploaded files → Recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Final

from sagittal.core.errors import ArchiveError, FormatError, InputError, ManifestError, Notice
from sagittal.core.formats import _sniff, bids, live_reader, parquet, table, table_guess, text
from sagittal.core.formats.aliases import segment_named
from sagittal.core.formats.archive import EPISODE_MANIFEST, ArchiveLimits, expand
from sagittal.core.formats.common_time import finish
from sagittal.core.formats.draft import Draft
from sagittal.core.formats.json_tree import JsonNode
from sagittal.core.formats.manifest import Manifest, parse_manifest
from sagittal.core.formats.refusals import explain_manifest, explain_unreadable
from sagittal.core.formats.source import SourceFile, digest_file, sha256
from sagittal.core.formats.source_spec import SourceSpec, read_source
from sagittal.core.formats.vendors import cwa, mapping_xml
from sagittal.core.formats.vendors.device_motion import SIGN_ASSUMED
from sagittal.core.formats.vendors.registry import find_vendor
from sagittal.core.frames import Segment
from sagittal.core.signals.correction import AS_READ, SensorCorrection
from sagittal.core.signals.recording import ImuStream, Recording
from sagittal.core.signals.sample_blocks import LongStream

ROW_BYTES: Final = 300.0
SENSOR_BYTES: Final = 250.0
"""Memory that an analysis needs for a row and for each sensor in it: two feet 0.8 kB, seven sensors 2."""

MOST_BYTES: Final = 4.2e9
"""A recording that needs more is read block by block, for the monitor of daily life: at 100 Hz five and a
half hours of seven sensors, fourteen of two feet. Half of what a process may use (server/settings.py)."""

MOST_ROWS_ALONE: Final = 2_000_000
"""More of one sensor alone is daily life, five and a half hours at 100 Hz: by blocks it needs less memory."""


@dataclass
class _Upload:
    """Content read so far."""

    drafts: list[Draft] = field(default_factory=list)
    long: dict[str, LongStream] = field(default_factory=dict)
    stored: list[Recording] = field(default_factory=list)
    manifests: list[tuple[str, bytes]] = field(default_factory=list)
    mapping: dict[str, Segment | None] = field(default_factory=dict)
    problems: list[tuple[str, InputError]] = field(default_factory=list)
    notices: list[Notice] = field(default_factory=list)
    sha256: dict[str, str] = field(default_factory=dict)
    guessed: bool = False
    undescribed: list[tuple[SourceFile, bytes]] = field(default_factory=list)
    """Tables that say by themselves how they are read, with their content."""
    sidecars: set[str] = field(default_factory=set)
    """Files that say how another one is read."""


def read_recording(
    files: Sequence[SourceFile], manifest: Manifest | None = None, limits: ArchiveLimits | None = None
) -> Recording:
    """Read one recording from its files in any supported format.

    Parameters
    ----------
    files : sensor files, archives of them, optionally a manifest or an OpenSense mapping among them.
    manifest : takes precedence over a manifest among the files, which is used for undeclared items.
    limits : of archives.

    Raises
    ------
    ArchiveError An archive violates a limit or is damaged (codes in `sagittal.core.formats.archive`).
    FormatError unknown_format if nothing could be read (with the formats tried), or the error of the only
        file; duplicate_device, counter_restart.
    ManifestError The manifest is invalid or does not match a file.
    """
    members = expand(files, limits)
    if not members:
        raise FormatError("empty", "There are no files; choose the recording's files, folder or zip.")
    upload = _Upload()
    manifest = _find_manifest(members, manifest, upload)
    sources = [(member, _describe(member, members, manifest, upload)) for member in members]
    sizes = [_measure(member, spec) for member, spec in sources]
    sensors = sum(count for _, count in sizes)
    for (member, spec), (rows, _) in zip(sources, sizes, strict=True):
        _take(member, spec, upload, long=is_too_long(rows, sensors))
    _read_undescribed(upload)
    if not upload.drafts and not upload.stored and not upload.long:
        raise explain_unreadable(upload.problems, upload.notices)
    recording = (
        _stored(upload) if upload.stored else Recording(finish(upload.drafts), segments={}, long=upload.long)
    )
    return _declared(recording, manifest, upload)


def _read_undescribed(upload: _Upload) -> None:
    """Read tables without a description, unless other files are the recording."""
    others = bool(upload.drafts or upload.stored or upload.long)
    for member, data in upload.undescribed:
        entry = None if others else table_guess.guess_entry(member)
        try:
            if entry is None:
                raise FormatError("manifest_needed", explain_manifest(member.name, data))
            upload.drafts += table.read_table(data, member.name, read_source(JsonNode(entry, "sources")))
        except FormatError as e:
            upload.problems.append((member.name, e))
            continue
        upload.guessed = True
        message = f"{member.name} was read without a manifest: {table_guess.describe_entry(entry)}."
        upload.notices.append(Notice("table_guessed", message, severity="info"))
        upload.sha256[member.name] = sha256(member.read())


def _find_manifest(
    members: Sequence[SourceFile], manifest: Manifest | None, upload: _Upload
) -> Manifest | None:
    """Find the manifest, which is required before tables can be read."""
    for member in members:
        if member.name.rsplit("/", 1)[-1] == EPISODE_MANIFEST:
            member_manifest = parse_manifest(member.read())
            manifest = member_manifest if manifest is None else manifest.complete_from(member_manifest)
            upload.sidecars.add(member.name)
            continue
        last = member.name.rsplit("/", 1)[-1].lower()
        if last.endswith(".json") and member.size < 1_000_000:
            data = text.to_utf8(member.read())
            if last == "manifest.json" or _sniff.sniff(data)[0] == "manifest":
                upload.manifests.append((member.name, data))
    if len(upload.manifests) > 1:
        names = " and ".join(n for n, _ in upload.manifests)
        raise ManifestError("manifest_twice", f"There are several manifests ({names}); keep one.")
    if not upload.manifests:
        return manifest
    upload_manifest = parse_manifest(upload.manifests[0][1])
    return upload_manifest if manifest is None else manifest.complete_from(upload_manifest)


def _describe(
    member: SourceFile, members: Sequence[SourceFile], manifest: Manifest | None, upload: _Upload
) -> SourceSpec | None:
    """Specification of a file: from the manifest, else from its sidecar files."""
    spec = manifest.source_of(member.name) if manifest else None
    if (spec and spec.columns) or not bids.is_table(member.name):
        return spec
    siblings = {m.name: m for m in members}
    channels, sidecar = (siblings.get(name) for name in bids.find_parts(member.name))
    if channels is None or not bids.looks_like(data := text.to_utf8(channels.read())):
        return spec
    upload.sidecars |= {m.name for m in (channels, sidecar) if m is not None}
    try:
        with member.open() as opened:
            head = text.to_utf8(opened.read(1 << 16))
        sidecar_text = text.to_utf8(sidecar.read()) if sidecar else None
        table = bids.describe_table(member.name, head, data, sidecar_text)
    except FormatError as e:
        upload.problems.append((member.name, e))
        upload.sidecars.add(member.name)
        return None
    upload.mapping |= table.worn
    return table.spec


def _measure(member: SourceFile, spec: SourceSpec | None) -> tuple[float, int]:
    """Rows and sensors of a file that can be read block by block; 0 for other and damaged ones."""
    with member.open() as opened:
        head = opened.read(1 << 16)
    if cwa.looks_like(head):
        with suppress(FormatError):
            stream = cwa.open_long(member.name, member.open)
            return stream.duration_s * stream.rate_hz, 1
    elif parquet.looks_like(head):
        return parquet.count_rows_and_sensors(member)
    elif spec and spec.columns:
        return table.estimate_rows(head, member.size), len(spec.columns)
    return 0.0, 0


def _take(member: SourceFile, spec: SourceSpec | None, upload: _Upload, *, long: bool) -> None:
    """Read one file; errors are collected without stopping the others."""
    if _take_long(member, spec, upload, long=long):
        return
    raw = member.read()
    data = raw if parquet.looks_like(raw) or live_reader.looks_like(raw) else text.to_utf8(raw)
    kind, format_name = _sniff.sniff(data)
    if member.name in upload.sidecars or any(member.name == name for name, _ in upload.manifests):
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
            upload.undescribed.append((member, data))
            return
        elif kind == "known":
            raise FormatError(
                "unsupported_format", f"{member.name} is {format_name}; {_sniff.advise(format_name)}"
            )
        else:
            message = f"{member.name} is {format_name} and was not used."
            upload.notices.append(Notice("ignored_file", message, severity="info"))
            return
        upload.sha256[member.name] = sha256(raw)
    except (ArchiveError, ManifestError):
        raise
    except FormatError as e:
        upload.problems.append((member.name, e))


def _take_long(member: SourceFile, spec: SourceSpec | None, upload: _Upload, *, long: bool) -> bool:
    """Open a file too long for memory for reading block by block; True if nothing else has to be read.

    A CWA file is always opened this way; a short one is also read completely, so that every protocol can use
    it.
    """
    with member.open() as opened:
        head = opened.read(len(cwa.MAGIC))
    is_cwa = cwa.looks_like(head)
    if not (is_cwa or long):
        return False
    try:
        if is_cwa:
            stream = cwa.open_long(member.name, member.open)
            if stream.device_id in upload.long:
                raise FormatError(
                    "duplicate_device",
                    f"{upload.long[stream.device_id].source} and {member.name} both come from sensor "
                    f"{stream.device_id}; upload one recording at a time.",
                    sensor=stream.device_id,
                )
            upload.long[stream.device_id] = stream
        elif parquet.looks_like(head):
            upload.stored.append(parquet.open_long(member))
        elif spec:
            upload.long |= table.open_long_table(member, spec)
        if long:
            upload.sha256[member.name] = digest_file(member)
    except ManifestError:
        raise
    except FormatError as e:
        upload.problems.append((member.name, e))
        return True
    return long


def is_too_long(rows: float, sensors: int) -> bool:
    """Whether a file of this many rows is too long to be analysed in memory with all sensors of its
    recording.

    Determined before reading.
    """
    if sensors == 1:
        return rows > MOST_ROWS_ALONE
    return rows * (ROW_BYTES + SENSOR_BYTES * sensors) > MOST_BYTES


def _stored(upload: _Upload) -> Recording:
    """A stored recording is complete: it cannot be combined with other files."""
    if len(upload.stored) > 1 or upload.drafts:
        raise FormatError(
            "several_recordings",
            f"{len(upload.stored)} stored recordings and {len(upload.drafts)} other sensor files were given; "
            "a Parquet recording or a live log is a whole take, upload it alone.",
        )
    return upload.stored[0]


def _declared(recording: Recording, manifest: Manifest | None, upload: _Upload) -> Recording:
    """Add the declarations of the manifest, the mapping file or the column names."""
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
    else:
        segments |= _worn(upload.drafts)
    used_segments = {s for s in segments.values() if s is not None}
    for device in dict.fromkeys((*recording.streams, *recording.long)):
        described = upload.guessed or (manifest is not None and manifest.sources and not manifest.sensors)
        own = segment_named(device) if described else None
        if own is not None and device not in segments and own not in used_segments:
            segments[device] = own
            used_segments.add(own)
    declared = manifest.protocol if manifest else None
    if declared is not None and recording.protocol not in ("walk", declared):
        difference = f"The file is of the protocol '{recording.protocol}', but it is analysed as '{declared}'"
        todo = f"For '{recording.protocol}', make a session with that protocol and upload the file there."
        notices.append(Notice("protocol_differs", f"{difference}, as was declared. {todo}"))
    streams, corrected = correct_streams(recording.streams, manifest.corrections if manifest else {})
    return replace(
        recording,
        streams=streams,
        segments=segments,
        subject=manifest.subject.complete_from(recording.subject) if manifest else recording.subject,
        protocol=declared or recording.protocol,
        belt_speed_mps=(manifest.belt_speed_mps if manifest else None) or recording.belt_speed_mps,
        test_limits=manifest.test_limits if manifest else recording.test_limits,
        mounting={**recording.mounting, **(manifest.mounting if manifest else {})},
        sha256={**recording.sha256, **upload.sha256},
        notices=(*notices, *corrected),
    )


def _worn(drafts: Sequence[Draft]) -> dict[str, Segment | None]:
    """Sensor placements given in the files; a segment claimed by two sensors is assigned to neither."""
    placements = {d.device_id: d.segment for d in drafts if d.segment is not None}
    count = Counter(placements.values())
    return {device: segment for device, segment in placements.items() if count[segment] == 1}


def correct_streams(
    streams: Mapping[str, ImuStream], corrections: Mapping[str, SensorCorrection]
) -> tuple[dict[str, ImuStream], list[Notice]]:
    """Streams with declared corrections of axes and units, and a notice for each."""
    corrections_by_id = {device.lower(): x for device, x in corrections.items()}
    out, notices = dict(streams), []
    for device, stream in streams.items():
        correction = corrections_by_id.get(device.lower())
        if correction is None:
            continue
        out[device] = replace(
            stream,
            acc=correction.correct_acc(stream.acc),
            gyr=None if stream.gyr is None else correction.correct_gyr(stream.gyr),
            # the vendor made it from what was wrong
            quat=None if correction.turns_axes else stream.quat,
            notices=tuple(
                n for n in stream.notices if n.code != SIGN_ASSUMED or correction.acc_axes == AS_READ
            ),
        )
        message = f"Sensor {device} is read with a correction, as was declared: {correction.say()}."
        notices.append(Notice("sensor_corrected", message, device, severity="info"))
    return out, notices


def _assign(
    declared: Mapping[str, Segment | None], recording: Recording, origin: str
) -> tuple[dict[str, Segment | None], list[Notice]]:
    """Match declared ids to streams, ignoring case; a notice for each declared sensor without a file."""
    ids = {d.lower(): d for d in (*recording.long, *recording.streams)}
    segments: dict[str, Segment | None] = {}
    missing: list[Notice] = []
    for device, segment in declared.items():
        stream_id = ids.get(device.lower())
        if stream_id is not None:
            segments[stream_id] = segment
        elif segment is not None:
            missing.append(
                Notice(
                    "sensor_missing",
                    f"The {origin} puts sensor {device} on {segment}, but no file holds it (found: "
                    f"{', '.join(ids.values())}); results that need {segment} are left out.",
                    device,
                )
            )
    return segments, missing
