"""Small recordings made in memory: MT Manager text, streams and takes with a known content."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence

import numpy as np

from sagittal.core.formats import SourceFile
from sagittal.core.formats.draft import signal_digest
from sagittal.core.frames import Floats, Segment
from sagittal.core.signals.recording import ImuStream, Recording

HEAD = "// Start Time: Unknown\n// Update Rate: {rate:.1f}Hz\n// Filter Profile: human (46.1)\n"


def signals(n: int, seed: int = 0, *, still: int = 0) -> tuple[Floats, Floats]:
    """Acceleration and rate of a body that stands for `still` samples, then swings at 1 Hz (100 Hz data)."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / 100.0
    moving = (np.arange(n) >= still).astype(float)
    swing = np.sin(2 * np.pi * t) * moving
    acc = np.stack([3.0 * swing, 9.81 + 2.0 * swing, 0.5 * swing], axis=1) + rng.normal(0, 0.03, (n, 3))
    gyr = np.stack([0.3 * swing, 0.1 * swing, 4.0 * swing], axis=1) + rng.normal(0, 0.005, (n, 3))
    return acc, gyr


def mt_text(
    acc: Floats,
    gyr: Floats | None = None,
    *,
    counter: Sequence[int] | None = None,
    separator: str = "\t",
    head: str | None = None,
    blank: str = "",
    rate: float = 100.0,
) -> str:
    """Rows as MT Manager writes them: PacketCounter, a blank SampleTimeFine, six decimals."""
    numbers = [acc] if gyr is None else [acc, gyr]
    names = [f"{kind}_{axis}" for kind, _ in zip(("Acc", "Gyr"), numbers, strict=False) for axis in "XYZ"]
    packets = range(len(acc)) if counter is None else counter
    rows = [
        separator.join([f"{c % 65536:05d}", blank, *(f"{v:.6f}" for v in row)])
        for c, row in zip(packets, np.hstack(numbers), strict=True)
    ]
    top = HEAD.format(rate=rate) if head is None else head
    return top + separator.join(["PacketCounter", "SampleTimeFine", *names]) + "\n" + "\n".join(rows) + "\n"


def mt_file(device: str = "00B40B91", n: int = 600, seed: int = 0, start: int = 0) -> SourceFile:
    """One sensor file."""
    acc, gyr = signals(n, seed, still=200)
    text = mt_text(acc, gyr, counter=range(start, start + n))
    return SourceFile.of_bytes(f"take_{device}.txt", text.encode())


def source(name: str, content: str | bytes) -> SourceFile:
    """Wrap text or bytes."""
    return SourceFile.of_bytes(name, content.encode() if isinstance(content, str) else content)


def zipped(members: Mapping[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A zip of members."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as z:
        for name, data in members.items():
            z.writestr(name, data)
    return out.getvalue()


def stream(
    device: str,
    acc: Floats,
    gyr: Floats | None,
    *,
    t_s: Floats | None = None,
    rate_hz: float = 100.0,
    clock: str = "counter",
    mag: Floats | None = None,
    quat: Floats | None = None,
) -> ImuStream:
    """A stream with the digest of its signals."""
    t = np.arange(len(acc)) / rate_hz if t_s is None else t_s
    return ImuStream(
        device, f"{device}.txt", t, acc, gyr, mag, quat, rate_hz, clock, signal_digest(acc, gyr, mag)
    )


def take(worn: Mapping[Segment, ImuStream], **more: ImuStream) -> Recording:
    """A recording of worn sensors and of others that are not mapped."""
    streams = {s.device_id: s for s in (*worn.values(), *more.values())}
    return Recording(streams, {s.device_id: segment for segment, s in worn.items()})
