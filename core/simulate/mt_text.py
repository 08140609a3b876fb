"""Streams in the format of Xsens MT Manager 4.x: one text file per sensor (docs/reference/formats.md)."""

from __future__ import annotations

import numpy as np

from sagittal.core.signals.recording import ImuStream, Recording

COUNTER_RANGE = 1 << 16
"""The packet counter wraps at 16 bit."""


def mt_text(stream: ImuStream, first_counter: int = 0) -> str:
    """Render one stream; lost samples have no row, as in real files.

    Parameters
    ----------
    first_counter : packet counter at t = 0 of the recording.
    """
    header = (
        "// Start Time: Unknown\n"
        f"// Update Rate: {stream.rate_hz:.1f}Hz\n"
        "// Filter Profile: none (simulated)\n"
        "// Option Flags: AHS Disabled ICC Disabled \n"
        "// Firmware Version: simulated\n"
    )
    columns = [("Acc", stream.acc), ("Gyr", stream.gyr), ("Mag", stream.mag)]
    present = [(name, a) for name, a in columns if a is not None]
    names = ["PacketCounter", "SampleTimeFine", *(f"{name}_{axis}" for name, _ in present for axis in "XYZ")]
    counter = (first_counter + np.rint(stream.t_s * stream.rate_hz)) % COUNTER_RANGE
    table = np.column_stack([counter, *(a for _, a in present)])
    row = "%05d\t" + "\t%.6f" * (3 * len(present)) + "\n"
    return header + "\t".join(names) + "\n" + (row * len(table)) % tuple(table.ravel().tolist())


def mt_files(recording: Recording, trial: str, first_counter: int = 0) -> dict[str, bytes]:
    """All sensors of a recording as files named `<trial>_<device id>.txt`."""
    return {
        f"{trial}_{device}.txt": mt_text(stream, first_counter).encode("ascii")
        for device, stream in recording.streams.items()
    }
