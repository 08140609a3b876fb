"""A small file of every format that names its own sensors: a sensor that turns, with a known content.

All hold the same take: 200 samples at 100 Hz, the sensor turns about y at `TURN` rad/s, z up first.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterable
from typing import Final

import numpy as np

from sagittal.core import rotation
from sagittal.core.frames import GRAVITY, Floats

N: Final = 200
RATE: Final = 100.0
TURN: Final = 1.5
T: Final = np.arange(N) / RATE
Q: Final = rotation.about(1, TURN * T)
"""Sensor → a frame whose z is up."""
ACC: Final = rotation.rotate(rotation.conjugate(Q), np.array([0.0, 0.0, GRAVITY]))
GYR: Final = np.tile([0.0, TURN, 0.0], (N, 1))
MAG: Final = rotation.rotate(rotation.conjugate(Q), np.array([0.5, 0.0, -0.8]))


def rows(*columns: Floats | list[str], separator: str = ",", end: str = "") -> str:
    """Lines of cells side by side, numbers with nine decimals."""
    cells = [
        [[f"{v:.9f}" for v in np.atleast_1d(row)] if not isinstance(row, str) else [row] for row in column]
        for column in columns
    ]
    return "".join(separator.join(sum(parts, [])) + end + "\n" for parts in zip(*cells, strict=True))  # noqa: RUF017


def dot(*, start_us: int = 4_294_000_000, head: str = "Synced") -> bytes:
    """As the DOT SDK logs it; the clock passes its 32 bits on the way."""
    top = (
        "sep=,\nDeviceTag:,L_shank,,\nFirmwareVersion:,2.4.0,,\nSyncStatus:,"
        + head
        + ",,\nOutputRate:,100Hz,,\n"
        "Measurement Mode:,Custom Mode 5,,\n© Movella Technologies B. V. 2005-2026,,\n\n"
        "PacketCounter,SampleTimeFine,Quat_W,Quat_X,Quat_Y,Quat_Z,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z\n"
    )
    fine = [str((start_us + 10_000 * i) % 2**32) for i in range(N)]
    return (top + rows([str(i + 1) for i in range(N)], fine, Q, ACC, np.degrees(GYR))).encode()


def apdm_studio() -> bytes:
    """Motion Studio, Format=7, two monitors."""
    per = [
        "Accelerometer",
        "",
        "",
        "Gyroscope",
        "",
        "",
        "Magnetometer",
        "",
        "",
        "Barometer",
        "Orientation",
        "",
        "",
        "",
    ]
    axes = ["X", "Y", "Z"] * 3 + ["", "S", "X", "Y", "Z"]

    def owner(number: str, label: str) -> list[str]:
        return [number, "", "", label, *[""] * 10]

    head = [
        ",".join(["Format=7", *owner("5718", "Lumbar"), *owner("5811", "Left Ankle")]),
        ",".join(["Time", *per, *per]),
        ",".join(["", *axes, *axes]),
    ]
    one = (ACC, GYR, MAG, np.zeros((N, 1)), Q)
    time = [str(1_550_879_504_438_281 + 10_000 * i) for i in range(N)]
    return ("\n".join(head) + "\n" + rows(time, *one, *one)).encode()


def apdm_lab(*, unit: str = "rad/s") -> bytes:
    """Mobility Lab: one column name "label/signal/axis" each, a row of units."""
    labels = ("Left Foot", "Right Foot")
    names = [
        f"{label}/{kind}/{axis}"
        for label in labels
        for kind, axes in (
            ("Acceleration", "XYZ"),
            ("Angular Velocity", "XYZ"),
            ("Orientation", ("Scalar", *"XYZ")),
        )
        for axis in axes
    ]
    units = ["s", *(["m/s^2"] * 3 + [unit] * 3 + [""] * 4) * 2]
    head = (
        "Test Name:,Walk\nSample Rate:,100,Hz\n" + ",".join(["Time", *names]) + "\n" + ",".join(units) + "\n"
    )
    return (head + rows(T[:, None], ACC, GYR, Q, ACC, GYR, Q)).encode()


def apdm_h5(*, version: int = 5, link: bool = False) -> bytes:
    """HDF5 of version 5, two monitors."""
    import h5py

    out = io.BytesIO()
    with h5py.File(out, "w") as file:
        file.attrs["FileFormatVersion"] = version
        for number, label in (("1234", b"Lumbar"), ("1235", b"Right Foot")):
            at = file.create_group(f"Sensors/{number}")
            at["Accelerometer"], at["Gyroscope"] = ACC.astype(np.float32), GYR.astype(np.float32)
            at["Magnetometer"] = MAG.astype(np.float32)
            if link:
                at["Time"] = h5py.ExternalLink("/etc/passwd", "/")
            else:
                at["Time"] = (1_550_879_504_438_281 + 10_000 * np.arange(N)).astype(np.uint64)
            at.create_group("Configuration").attrs["Label 0"] = np.bytes_(label)
            at["Configuration"].attrs["Sample Rate"] = 100
            file[f"Processed/{number}/Orientation"] = Q.astype(np.float32)
    return out.getvalue()


def mvnx(*, head: str = "", skip: tuple[int, ...] = ()) -> bytes:
    """Version 4, two sensors, the three poses before the frames."""

    def text(x: Iterable[float]) -> str:
        return " ".join(f"{v:.6f}" for v in x)

    free = rotation.rotate(Q, ACC) - np.array([0.0, 0.0, GRAVITY])
    poses = "".join(
        f'<frame time="0" tc="" ms="0" type="{kind}"><orientation>1 0 0 0</orientation></frame>\n'
        for kind in ("identity", "tpose", "tpose-isb")
    )
    frames = "".join(
        f'<frame time="{i * 10}" index="{i}" ms="0" type="normal"><orientation>{text(Q[i])}</orientation>'
        f"<sensorFreeAcceleration>{text([*free[i], *free[i]])}</sensorFreeAcceleration>"
        f"<sensorMagneticField>{text([*MAG[i], *MAG[i]])}</sensorMagneticField>"
        f"<sensorOrientation>{text([*Q[i], *Q[i]])}</sensorOrientation></frame>\n"
        for i in range(N)
        if i not in skip
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        + head
        + '<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">\n'
        '<subject label="S" frameRate="100" segmentCount="1"><sensors><sensor label="RightLowerLeg"/>'
        f'<sensor label="Head"/></sensors>\n<frames segmentCount="1">\n{poses}{frames}</frames>'
        "</subject></mvnx>"
    ).encode()


def shimmer(*, acc: Floats = ACC, unit: str = "m/(s^2)", kind: str = "CAL") -> bytes:
    """Consensys: names, units, a separator at the end of each line."""
    at = "Shimmer_952D_"
    what = ["Timestamp_Unix", *(f"{x}_{a}" for x in ("Accel_LN", "Accel_WR", "Gyro", "Mag") for a in "XYZ")]
    units = ["ms", *[unit] * 6, *["deg/s"] * 3, *["local_flux"] * 3]
    head = (
        '"sep=\\t"\n'
        + "".join(f"{at}{w}_{kind}\t" for w in what)
        + "\n"
        + "".join(f"{u}\t" for u in units)
        + "\n"
    )
    time = 1_718_000_000_000.0 + T[:, None] * 1000
    return (head + rows(time, acc, ACC, np.degrees(GYR), MAG, separator="\t", end="\t")).encode()


def phone(*, order: tuple[int, int, int] = (0, 1, 2), listed: bool = False) -> bytes:
    """DeviceMotion events; `order`: which axis of x, y, z each of alpha, beta and gamma turns about."""
    events = [
        {
            "t_ms": 10.0 * i,
            "accelerationIncludingGravity": dict(zip("xyz", ACC[i].tolist(), strict=True)),
            "rotationRate": dict(
                zip(("alpha", "beta", "gamma"), np.degrees(GYR[i])[list(order)].tolist(), strict=True)
            ),
            "interval": 10,
        }
        for i in range(N)
    ]
    return json.dumps(events if listed else {"note": "", "events": events}).encode()


VENDOR_SAMPLES: Final[dict[str, tuple[str, Callable[[], bytes]]]] = {
    "Movella DOT CSV": ("L_shank.csv", dot),
    "APDM CSV": ("studio.csv", apdm_studio),
    "APDM CSV, Mobility Lab": ("lab.csv", apdm_lab),
    "APDM HDF5": ("opal.h5", apdm_h5),
    "Xsens MVNX": ("walk.mvnx", mvnx),
    "Shimmer Consensys CSV": ("shimmer.csv", shimmer),
    "DeviceMotion JSON": ("phone.json", phone),
}
"""Format → name and bytes of a file; what is after a comma tells two files of one format apart."""


def bids_parts(*, acc_unit: str = "g", types: tuple[str, str] = ("ACCEL", "GYRO")) -> dict[str, bytes]:
    """A table without a header and its two sidecars."""
    stem = "sub-01/motion/sub-01_task-walk_tracksys-imu"
    lines = ["name\tcomponent\ttype\ttracked_point\tunits\tsampling_frequency"]
    for point in ("LeftFoot", "Lumbar"):
        for kind, unit in zip(types, (acc_unit, "deg/s"), strict=True):
            lines += [f"{point}_{kind}_{a}\t{a}\t{kind}\t{point}\t{unit}\t100" for a in "xyz"]
    body = rows(ACC / GRAVITY, np.degrees(GYR), ACC / GRAVITY, np.degrees(GYR), separator="\t")
    return {
        f"{stem}_motion.tsv": body.encode(),
        f"{stem}_channels.tsv": "\n".join(lines).encode(),
        f"{stem}_motion.json": json.dumps(
            {"SamplingFrequency": 90, "SamplingFrequencyEffective": RATE}
        ).encode(),
    }
