"""Table-top calibration: sensors start on a table in a specified orientation and are carried to the body.

Kianifar et al.: the gyroscope is integrated from the table to the leg. The person stands still and faces
along the arrow on the table (docs/science/squat.md, "From the table").
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import acos, degrees, radians

import numba
import numpy as np

from sagittal.core.errors import CalibrationError, Notice
from sagittal.core.frames import R_NEUTRAL, Floats, Segment
from sagittal.core.message import Message
from sagittal.core.rotation import conjugate, exp, from_matrix, mean, multiply, rotate, to_matrix
from sagittal.core.rotation.compiled import turn
from sagittal.core.signals.recording import SensorSignals, UniformRecording
from sagittal.core.signals.rest import QuietParams, Window, find_rest_windows, find_runs, index_window


@dataclass(frozen=True)
class TableTopParams:
    """Protocol requirements (docs/science/squat.md, "From the table").

    Parameters
    ----------
    longest_s : longest time between the two rests. edge_s : tolerance for the first rest to begin after the
    start and the last to end before the end of the recording.
    still_s, still : length of the quietest part of the rest on the table, and the maximum SD of its rate in
    rad/s: a hand-held sensor varies more.
    mean_s : averaging time of the rest on the body. slope : maximum tilt of the device on the table, rad.
    drift : tilt error at the end, corrected by gravity, above which a notice is given, rad.
    facing : of the person relative to the arrow, left positive, rad.
    table : (w, x, y, z) device on the table in arrow axes: x along the arrow, z up.
    stand_s : shortest standing with all sensors attached. worn : a sensor whose vertical has rotated by more
    than this since the table counts as attached to the body, rad.
    """

    rest: QuietParams = field(default_factory=QuietParams)
    longest_s: float = 60.0
    edge_s: float = 1.0
    still_s: float = 1.0
    still: float = radians(1.0)
    mean_s: float = 1.0
    slope: float = radians(15.0)
    drift: float = radians(3.0)
    facing: float = 0.0
    table: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    stand_s: float = 2.0
    worn: float = radians(45.0)


@dataclass(frozen=True, eq=False)
class TableTopMounts:
    """Sensor-to-segment alignment from the table-top protocol.

    Parameters
    ----------
    R_segment_sensor : segment → (3, 3). gyro_bias : segment → (3,) rad/s, on the table.
    drift_rad : segment → tilt error corrected by gravity at the end. moved_s : segment → time between the
    rests.
    """

    R_segment_sensor: Mapping[Segment, Floats]
    gyro_bias: Mapping[Segment, Floats]
    drift_rad: Mapping[Segment, float]
    moved_s: Mapping[Segment, float]
    notices: tuple[Notice, ...] = ()


def calibrate_table_top(recording: UniformRecording, params: TableTopParams | None = None) -> TableTopMounts:
    """Estimate the alignment of every sensor, tracking it from the table to a person in neutral standing.

    Raises
    ------
    CalibrationError `no_segment`, `table_not_still`, `body_not_still`, `table_top_too_long`, `table_top_gap`,
    `table_orientation`.

    References
    ----------
    Kianifar et al. 2019, "Calibration protocol", equations 2 to 5, doi:10.1177/2055668318813455. There the
    increment is written as the matrix itself; tilts are not corrected and no rest is required.
    """
    params = params or TableTopParams()
    if not recording.sensors:
        raise CalibrationError("no_segment", "No sensor is assigned to a segment; assign those on the table.")
    mounts: dict[Segment, Floats] = {}
    biases: dict[Segment, Floats] = {}
    drifts: dict[Segment, float] = {}
    moved: dict[Segment, float] = {}
    notices = []
    to_segment = conjugate(multiply(exp(np.array([0.0, 0.0, params.facing])), from_matrix(R_NEUTRAL)))
    for segment, signals in recording.sensors.items():
        table, body = _find_ends(recording, segment, params)
        part = index_window(table, recording.rate_hz)
        biases[segment] = signals.gyr[part].mean(axis=0)
        start = _lie_on_table(segment, signals.acc[part].mean(axis=0), params)
        q, drifts[segment] = _carry(signals, biases[segment], start, part, body, recording.rate_hz, params)
        mounts[segment], moved[segment] = to_matrix(multiply(to_segment, q)), body[0] - table[1]
        if drifts[segment] > params.drift:
            message = Message(
                "{segment}: its inclination drifted by {degrees:.1f}° between the table and the body; its "
                "heading may be off by as much. Repeat the transfer more quickly.",
                segment=segment,
                degrees=degrees(drifts[segment]),
            )
            notices.append(Notice("table_top_drift", message, sensor=segment))
    return TableTopMounts(mounts, biases, drifts, moved, tuple(notices))


def find_worn_standing(recording: UniformRecording, params: TableTopParams | None = None) -> Window:
    """First standing with every sensor off the table, in a recording that continues after it.

    While one sensor is being attached the others are still, so stillness alone is not sufficient.

    Raises
    ------
    CalibrationError `table_not_still`, `body_not_still`.
    """
    params = params or TableTopParams()
    rests = find_rest_windows(recording, params.rest)
    if not rests or rests[0][0] > params.edge_s:
        raise CalibrationError(
            "table_not_still",
            "The sensors are not all still when the trial starts; start the recording before touching them.",
            t_s=0.0,
        )
    for candidate in rests[1:]:
        if candidate[1] - candidate[0] >= params.stand_s and all(
            _turned(x, recording.rate_hz, rests[0], candidate) > params.worn
            for x in recording.sensors.values()
        ):
            return candidate
    raise CalibrationError(
        "body_not_still",
        Message(
            "No quiet standing of {stand_s:g} s detected with all sensors attached; stand still before "
            "squatting.",
            stand_s=params.stand_s,
        ),
        t_s=rests[0][1],
    )


def crop(recording: UniformRecording, end_s: float) -> UniformRecording:
    """The recording up to a time."""
    part = slice(0, index_window((0.0, end_s), recording.rate_hz).stop)
    sensors = {
        s: SensorSignals(
            x.device_id,
            x.acc[part].copy(),
            x.gyr[part].copy(),
            None if x.mag is None else x.mag[part].copy(),
            x.valid[part].copy(),
            x.interpolated[part].copy(),
        )
        for s, x in recording.sensors.items()
    }
    return replace(recording, t_s=recording.t_s[part].copy(), sensors=sensors)


def _turned(signals: SensorSignals, rate_hz: float, a: Window, b: Window) -> float:
    """Angle between the verticals of a sensor in two rests, rad."""
    u, v = (signals.acc[index_window(w, rate_hz)].mean(axis=0) for w in (a, b))
    return acos(float(np.clip(u @ v / (np.linalg.norm(u) * np.linalg.norm(v)), -1.0, 1.0)))


def _find_ends(
    recording: UniformRecording, segment: Segment, params: TableTopParams
) -> tuple[Window, Window]:
    """The rest periods of a sensor on the table and on the body."""
    end_s = len(recording.t_s) / recording.rate_hz
    rests = find_rest_windows(recording, params.rest, (segment,))
    if not rests or rests[0][0] > params.edge_s:
        raise CalibrationError(
            "table_not_still",
            Message(
                "{segment} is not still when the trial starts; leave it on the table for at least "
                "{shortest_s:g} s after the start.",
                segment=segment,
                shortest_s=params.rest.shortest_s,
            ),
            sensor=segment,
            t_s=0.0,
        )
    if len(rests) < 2 or rests[-1][1] < end_s - params.edge_s:
        raise CalibrationError(
            "body_not_still",
            Message(
                "{segment} is not still on the body when the trial ends; stand still for at least "
                "{shortest_s:g} s before stopping.",
                segment=segment,
                shortest_s=params.rest.shortest_s,
            ),
            sensor=segment,
            t_s=end_s,
        )
    table, body = rests[0], rests[-1]
    if body[0] - table[1] > params.longest_s:
        raise CalibrationError(
            "table_top_too_long",
            Message(
                "Transferring {segment} from the table took {table:.0f} s; the gyroscope is accurate enough "
                "for {longest_s:g} s.",
                segment=segment,
                table=body[0] - table[1],
                longest_s=params.longest_s,
            ),
            sensor=segment,
            t_s=table[1],
        )
    table, rate = _find_stillest(recording, segment, table, params)
    if rate > params.still:
        raise CalibrationError(
            "table_not_still",
            Message(
                "{segment} is not still on the table: its angular rate varies by {rate:.1f} °/s (limit "
                "{still:.0f} °/s). Do not touch it for {still_s:g} s after the start.",
                segment=segment,
                rate=degrees(rate),
                still=degrees(params.still),
                still_s=params.still_s,
            ),
            sensor=segment,
            t_s=table[0],
        )
    silent = find_runs(~recording.sensors[segment].valid)
    if silent:
        raise CalibrationError(
            "table_top_gap",
            Message(
                "{segment} lost data during the transfer from the table, so its rotation is unknown.",
                segment=segment,
            ),
            sensor=segment,
            t_s=silent[0][0] / recording.rate_hz,
        )
    return table, body


def _find_stillest(
    recording: UniformRecording, segment: Segment, window: Window, params: TableTopParams
) -> tuple[Window, float]:
    """The part of a rest with the least variation of the rate, and its standard deviation, rad/s.

    A rest may end with the onset of a slow movement, which must not enter the bias.
    """
    part, width = index_window(window, recording.rate_hz), round(params.still_s * recording.rate_hz)
    gyr = recording.sensors[segment].gyr
    starts = range(part.start, max(part.start, part.stop - width) + 1, max(1, width // 10))
    spread = [float(np.sqrt(gyr[a : a + width].var(axis=0).sum())) for a in starts]
    best = int(np.argmin(spread))
    first = starts[best]
    return (first / recording.rate_hz, (first + width) / recording.rate_hz), spread[best]


def _lie_on_table(segment: Segment, force: Floats, params: TableTopParams) -> Floats:
    """Orientation (4,) of a device on the table, in arrow axes, levelled by gravity."""
    q = np.array(params.table) / np.linalg.norm(params.table)
    level = _turn_upright(rotate(q, force))
    slope = float(2.0 * acos(min(1.0, abs(float(level[0])))))
    if slope > params.slope:
        raise CalibrationError(
            "table_orientation",
            Message(
                "{segment} lies {slope:.0f}° off the specified orientation on the table (limit "
                "{slope2:.0f}°); lay all sensors the same way up.",
                segment=segment,
                slope=degrees(slope),
                slope2=degrees(params.slope),
            ),
            sensor=segment,
            t_s=0.0,
        )
    return multiply(level, q)


def _carry(
    signals: SensorSignals,
    bias: Floats,
    start: Floats,
    part: slice,
    body: Window,
    rate_hz: float,
    params: TableTopParams,
) -> tuple[Floats, float]:
    """Orientation (4,) on the body in arrow axes, and the tilt error corrected by gravity, rad."""
    gyr = np.ascontiguousarray(signals.gyr[part.stop - 1 :] - bias)
    q = np.empty((len(gyr), 4))
    integrate_turns(gyr, 1.0 / rate_hz, start, q)
    standing = index_window((max(body[0], body[1] - params.mean_s), body[1]), rate_hz)
    orientation = mean(q[standing.start - part.stop + 1 : standing.stop - part.stop + 1])
    level = _turn_upright(rotate(orientation, signals.acc[standing].mean(axis=0)))
    return multiply(level, orientation), float(2.0 * acos(min(1.0, abs(float(level[0])))))


def _turn_upright(force: Floats) -> Floats:
    """The shortest rotation (4,) that maps a vector (3,) to the vertical."""
    up = force / np.linalg.norm(force)
    axis = np.array([up[1], -up[0], 0.0])
    sine = float(np.linalg.norm(axis))
    angle = float(np.arctan2(sine, up[2]))
    if sine < 1e-12:
        axis, sine = np.array([1.0, 0.0, 0.0]), 1.0
    return exp(angle * axis / sine)


@numba.njit(cache=True, nogil=True)  # type: ignore[misc, unused-ignore]
def integrate_turns(gyr, dt, start, out):  # type: ignore[no-untyped-def]
    """Write orientations (n, 4) of a sensor with rates (n, 3), start (4,) at the first sample.

    R ← R Exp(ω Δt) of Kianifar equations 4 and 5 (their increment is the matrix of a body-fixed rotation, so
    it multiplies from the right); the rate of a step is the mean of the rates at its ends.
    """
    h = 0.5 * dt
    out[0] = start
    for k in range(1, gyr.shape[0]):
        out[k] = out[k - 1]
        turn(
            out[k], h * (gyr[k - 1, 0] + gyr[k, 0]), h * (gyr[k - 1, 1] + gyr[k, 1]),
            h * (gyr[k - 1, 2] + gyr[k, 2]),
        )  # fmt: skip
