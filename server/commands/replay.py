"""`sagittal replay`: stream a recording to a server like a tablet, optionally with simulated faults."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from sagittal.core.errors import InputError, SagittalError
from sagittal.server.commands.options import Manifest, Take, Whole

if TYPE_CHECKING:
    from sagittal.core.signals.recording import Recording
    from sagittal.server.live.client import StreamReport
    from sagittal.server.live.playback import DueBatch


def replay(
    paths: Take,
    /,
    *,
    to: Annotated[str, Parameter(metavar="URL")],
    code: str,
    manifest: Manifest = None,
    speed: float = 1.0,
    drop: Annotated[float, Parameter(metavar="P")] = 0.0,
    jitter: Annotated[float, Parameter(metavar="MS")] = 0.0,
    batch: Whole = 10,
) -> int:
    """Pair by code and stream files, folders or zips of one trial.

    Parameters
    ----------
    to
        address of the server, http://host:port
    code
        pairing code from the session's live page
    speed
        1 = as recorded (default), 0 = immediately
    drop
        probability per batch of dropping the connection
    jitter
        maximum delay of batches
    batch
        samples per batch (default 10)

    Returns
    -------
    0 if everything is acknowledged and the trial is finished, otherwise 1.
    """
    from sagittal.server.live.playback import cut

    try:
        _check(speed, drop, jitter)
        recording = _read(paths, manifest)
        batches = cut(recording, batch)
        report = _stream(recording, batches, to, code, speed=speed, drop=drop, jitter=jitter)
    except SagittalError as error:
        sys.stderr.write(f"Not replayed ({error.code}): {error.message}\n")
        return 1
    _say(_summary(report, batches))
    return 0 if report.problem is None else 1


def _stream(
    recording: Recording,
    batches: Sequence[DueBatch],
    to: str,
    code: str,
    *,
    speed: float,
    drop: float,
    jitter: float,
) -> StreamReport:
    """Pair with the server and stream to the end; `jitter` in ms."""
    from sagittal.server.live.client import StreamFaults, stream
    from sagittal.server.live.pairing import pair
    from sagittal.server.live.playback import hello_of, pace_batches

    pairing = pair(to, code)
    hello = hello_of(recording, pairing.take)
    _say(
        f"Streaming {len(hello.sensors)} sensors, {batches[-1].at_s:.1f} s in {len(batches)} batches, to "
        f"{pairing.session_title or 'the session'} of patient {pairing.patient_code}."
    )
    if not any(sensor.segment for sensor in hello.sensors):
        _say("No sensor is assigned to a segment, so nothing can be estimated live; give a --manifest.")
    return asyncio.run(
        stream(
            pairing.socket,
            pairing.token,
            hello,
            pace_batches(batches, speed),
            faults=StreamFaults(drop, jitter / 1000.0),
            hear=_heard,
        )
    )


def _check(speed: float, drop: float, jitter: float) -> None:
    for name, value, ok, expected in (
        ("--speed", speed, 0.0 <= speed < float("inf"), "0 or more"),
        ("--drop", drop, 0.0 <= drop < 1.0, "0 to below 1"),
        ("--jitter", jitter, 0.0 <= jitter < float("inf"), "0 or more milliseconds"),
    ):
        if not ok:
            raise InputError("bad_option", f"{name} is {value:g}; expected {expected}.")


def _read(paths: Sequence[Path], manifest: Path | None) -> Recording:
    from sagittal.core.formats import list_source_files, parse_manifest, read_named_file, read_recording

    declared = parse_manifest(read_named_file(manifest)) if manifest else None
    return read_recording(list(list_source_files(paths)), declared)


def _heard(message: Mapping[str, Any]) -> None:
    if message.get("type") == "command":
        _say(f"The therapist asks: {message.get('command')}.")


def _summary(report: StreamReport, batches: Sequence[DueBatch]) -> str:
    half, most = (1000.0 * report.ack_quantile(share) for share in (0.5, 0.99))
    text = (
        f"{report.sent} of {len(batches)} batches acknowledged, half within {half:.0f} ms, 99 % within "
        f"{most:.0f} ms; {report.resent} sent again after {report.reconnects} reconnections.\n"
        f"Finished as recording {report.recording}, sha256 {report.sha256[:12]}…."
    )
    if report.problem:
        text += f"\nThe server kept the take but found its end wrong ({report.problem})."
    return text


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()
