"""Tablet codecs in Chromium compared with the server's own decoding of the same bytes."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Browser, Page

from sagittal.core.formats import SourceFile, read_recording
from sagittal.core.formats.live_log import SampleBatch, encode_batch, record, scan
from tests.browser.conftest import RunningServer
from tests.data import data_folder

HELLO = {
    "type": "hello",
    "protocol": "sagittal.live.v1",
    "take": "a" * 32,
    "source": "replay",
    "streams": [
        {
            "stream": 0,
            "rate_hz": 100.0,
            "clock": "shared",
            "sensors": [{"id": "A1", "segment": "pelvis", "acc_range": 160.0, "gyr_range": None}],
        }
    ],
}


@pytest.fixture(scope="module")
def blank(flat: Browser, running: RunningServer) -> Iterator[Page]:
    """Empty page of our origin for importing modules."""
    context = flat.new_context(base_url=running.url)
    page = context.new_page()
    page.goto("/static/icon.svg")
    yield page
    context.close()


def run(page: Page, module: str, body: str, argument: Any = None) -> Any:
    """Result of a script body with the module `m` and the argument `a`."""
    return page.evaluate(
        f"async (a) => {{ const m = await import('/static/js/{module}');"
        " const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));"
        " const text = (b) => btoa(Array.from(b, (v) => String.fromCharCode(v)).join(''));"
        f" {body} }}",
        argument,
    )


def b64(data: bytes) -> str:
    return base64.b64encode(data).decode()


@pytest.mark.parametrize("offsets", [False, True])
def test_a_batch_has_the_bytes_that_the_server_would_write(blank: Page, offsets: bool) -> None:
    rng = np.random.default_rng(3)
    samples = rng.normal(0, 20, (5, 7, 9)).astype(np.float32)
    samples[1, 2, 6:] = np.nan
    samples[3, 0, 0] = np.inf
    late = np.arange(5, dtype=np.uint32) * 10_007 if offsets else None
    batch = SampleBatch(3, 2**40 + 7, 1_795_000_000_123_456, 1_795_000_000_200_001, samples, late)
    result = run(
        blank,
        "common/wire.js",
        """return text(m.encodeBatch({ stream: 3, seq: 2 ** 40 + 7, t0Us: 1795000000123456, nImu: 7,
          sentUs: 1795000000200001, samples: new Float32Array(bytes(a.samples).buffer),
          offsetsUs: a.offsets && Uint32Array.from(a.offsets) }));""",
        {"samples": b64(samples.tobytes()), "offsets": None if late is None else late.tolist()},
    )
    assert base64.b64decode(result) == encode_batch(batch)


def test_a_batch_of_the_server_is_read_back(blank: Page) -> None:
    samples = np.arange(2 * 9, dtype=np.float32).reshape(2, 1, 9)
    frame = encode_batch(SampleBatch(1, 5, 10, 20, samples, np.array([0, 11], np.uint32)))
    read = run(
        blank,
        "common/wire.js",
        "const b = m.decodeBatch(bytes(a));"
        " return { ...b, samples: [...b.samples], offsetsUs: [...b.offsetsUs] };",
        b64(frame),
    )
    assert read == {
        "stream": 1, "seq": 5, "t0Us": 10, "sentUs": 20, "nImu": 1, "nSamples": 2,
        "samples": samples.ravel().tolist(), "offsetsUs": [0, 11],
    }  # fmt: skip
    broken = bytearray(frame)
    broken[40] ^= 1
    result = run(
        blank,
        "common/wire.js",
        "try { m.decodeBatch(bytes(a)); return 'read'; } catch (e) { return e.message; }",
        b64(bytes(broken)),
    )
    assert result == "a damaged batch"


def test_a_saved_rest_is_a_recording_that_the_server_reads(blank: Page) -> None:
    rng = np.random.default_rng(4)
    samples = rng.normal(0, 5, (40, 5, 1, 9)).astype(np.float32)
    frames = [encode_batch(SampleBatch(0, n + 60, n * 50_000, n * 50_000, samples[n])) for n in range(40)]
    result = run(
        blank,
        "common/wire.js",
        "const { Sha256 } = await import('/static/js/common/sha256.js');"
        "const hash = new Sha256(), frames = a.frames.map(bytes);"
        "for (const frame of frames) hash.update(m.payload(frame));"
        "const parts = m.logParts({ ...a.hello, token: 'secret' }, frames, hash.hex());"
        " return text(new Uint8Array(await new Blob(parts).arrayBuffer()));",
        {"hello": HELLO, "frames": [b64(f) for f in frames]},
    )
    log = base64.b64decode(result)
    assert b"secret" not in log
    recording = read_recording([SourceFile("rest.sagittal-live", len(log), lambda: log)], None)
    assert recording.notices == ()
    assert recording.segments == {"A1": "pelvis"}
    stream = recording.streams["A1"]
    np.testing.assert_array_equal(stream.acc, samples[:, :, 0, :3].reshape(-1, 3))
    np.testing.assert_allclose(np.diff(stream.t_s), 0.01, atol=1e-9)


def test_the_browsers_scan_of_a_log_stops_where_the_servers_does(blank: Page) -> None:
    whole = b"SAGLIVE1\n" + record("H", json.dumps(HELLO).encode()) + record("B", b"x" * 50)
    for cut in (9, 30, len(whole) - 1, len(whole)):
        kinds = run(
            blank, "common/wire.js", "return m.scanLog(bytes(a)).map((r) => r.kind);", b64(whole[:cut])
        )
        assert kinds == [r.kind for r in scan(whole[:cut])[0]]


def test_sha256_goes_on_from_a_saved_state(blank: Page) -> None:
    data = np.random.default_rng(1).bytes(10_000)
    for length in (0, 1, 55, 56, 63, 64, 65, 119, 128, 10_000):
        result = run(
            blank,
            "common/sha256.js",
            """const all = bytes(a); let hash = new m.Sha256(), step = 1;
            for (let at = 0; at < all.length; step = (step * 5) % 211 + 1) {
              hash.update(all.subarray(at, at += step));
              hash = new m.Sha256(structuredClone(hash.state()));
            }
            return hash.hex();""",
            b64(data[:length]),
        )
        assert result == hashlib.sha256(data[:length]).hexdigest(), length


def test_dot_payloads_decode_to_the_vectors(blank: Page) -> None:
    vectors = json.loads(
        (data_folder("formats", "xsens_dot") / "SYNTHETIC_ble_payload_vectors.json").read_text()
    )
    body = """const view = new DataView(Uint8Array.from(a.hex.match(/../g), (h) => parseInt(h, 16)).buffer);
        return m.decode(a.mode, view);"""
    rate = run(
        blank, "capture/sources/dot_payload.js", body, {"hex": vectors["rate_quantities_21"], "mode": 21}
    )
    expected = vectors["expected"]
    assert rate["tUs"] == expected["rate"]["t_us"]
    np.testing.assert_allclose(rate["acc"], expected["rate"]["acc"], rtol=1e-6)
    np.testing.assert_allclose(rate["gyr"], np.radians(expected["rate"]["gyr_dps"]), rtol=1e-6)
    quat = run(
        blank, "capture/sources/dot_payload.js", body, {"hex": vectors["complete_quaternion_3"], "mode": 3}
    )
    assert quat["tUs"] == expected["quat"]["t_us"]
    np.testing.assert_allclose(quat["quat"], expected["quat"]["q_wxyz"])
    np.testing.assert_allclose(quat["free_acc"], expected["quat"]["free_acc"], rtol=1e-6)


def test_dot_modes_have_the_sizes_of_the_specification_and_short_ones_are_refused(blank: Page) -> None:
    result = run(
        blank,
        "capture/sources/dot_payload.js",
        """const reads = (mode, n) => {
          try { return Boolean(m.decode(mode, new DataView(new ArrayBuffer(n)))); } catch { return false; }
        };
        const size = (mode) => Array.from({ length: 70 }, (_, n) => n).find((n) => reads(mode, n));
        return Object.fromEntries([3, 5, 20, 21].map((mode) => [mode, size(mode)]));""",
    )
    assert result == {"3": 32, "5": 20, "20": 34, "21": 28}


def test_the_dot_clock_goes_on_over_its_wrap(blank: Page) -> None:
    steps = [2**32 - 20_000, 2**32 - 3_000, 13_667, 30_333]
    result = run(
        blank,
        "capture/sources/dot_payload.js",
        "const c = new m.Clock(); return a.map((t) => c.read(t));",
        steps,
    )
    assert np.diff(result).tolist() == [17_000, 16_667, 16_666]


READ = """const files = a.map(([name, content]) => new File([bytes(content)], name));
    const { tracks, copies, segments } = await m.readFiles(files);
    return { copies, segments, tracks: tracks.map((t) => ({
      ids: t.ids, rateHz: t.rateHz, clock: t.clock, tUs: [...t.tUs],
      values: t.values.map((v) => text(new Uint8Array(v.buffer))) })) };"""


def _read(page: Page, files: list[tuple[str, bytes]]) -> Any:
    return run(page, "capture/sources/files.js", READ, [[name, b64(content)] for name, content in files])


def _values(track: dict[str, Any], i: int) -> np.ndarray[Any, np.dtype[np.float32]]:
    return np.frombuffer(base64.b64decode(track["values"][i]), np.float32).reshape(-1, 9)


def _server_reading(files: list[tuple[str, bytes]]) -> Any:
    return read_recording([SourceFile(n, len(c), lambda c=c: c) for n, c in files], None)  # type: ignore[misc]


def test_xsens_text_is_read_as_the_server_reads_it(blank: Page) -> None:
    folder = data_folder("neura_walk", "rawimu")
    files = [(p.name, p.read_bytes()) for p in sorted(folder.glob("*.txt"))]
    result = _read(blank, files)
    assert {c["id"] for c in result["copies"]} == {"00B40C49", "00B40C4A"}
    (track,) = result["tracks"]
    assert track["rateHz"] == 100
    assert track["clock"] == "shared"
    assert len(track["ids"]) == 9
    streams = _server_reading(files).streams
    for i, device in enumerate(track["ids"]):
        stream = streams[device]
        theirs = np.hstack([stream.acc, stream.gyr, stream.mag]).astype(np.float32)
        np.testing.assert_array_equal(_values(track, i), theirs)
        np.testing.assert_allclose(np.array(track["tUs"]) / 1e6, stream.t_s - stream.t_s[0], atol=1e-6)


def test_sensors_that_start_and_end_apart_share_their_packet_counter_over_its_wrap(blank: Page) -> None:
    def file(first: int, n: int, separator: str) -> bytes:
        rows = [
            "// Update Rate: 100.0Hz",
            separator.join(["PacketCounter", "Acc_X", "Acc_Y", "Acc_Z", "Gyr_X", "Gyr_Y", "Gyr_Z"]),
        ]
        rows += [
            separator.join([str(count % 65_536), *(f"{count % 100 + c:.6f}" for c in range(6))])
            for count in range(first, first + n)
            if count != 65_540  # a lost packet
        ]
        return "\r\n".join(rows).encode()

    files = [("a_00B40001.txt", file(65_530, 30, "\t")), ("b_00B40002.txt", file(65_534, 30, ";"))]
    (track,) = _read(blank, files)["tracks"]
    t = np.array(track["tUs"])
    assert t[0] == 0
    assert t[-1] == 330_000, "from the first start to the last end"
    assert sorted(set(np.diff(t))) == [10_000, 20_000]
    assert np.isnan(_values(track, 1)[:4]).all()
    assert np.isnan(_values(track, 0)[-4:]).all()
    pair = ~np.isnan(_values(track, 0)[:, 0]) & ~np.isnan(_values(track, 1)[:, 0])
    np.testing.assert_array_equal(_values(track, 0)[pair, :6], _values(track, 1)[pair, :6])


def test_a_live_log_plays_with_its_segments_and_clocks(blank: Page) -> None:
    hello = json.loads(json.dumps(HELLO))
    hello["streams"][0]["clock"] = "own"
    samples = np.random.default_rng(2).normal(0, 1, (20, 1, 9)).astype(np.float32)
    log = b"SAGLIVE1\n" + record("H", json.dumps(hello).encode())
    for n in range(4):
        log += record("B", encode_batch(SampleBatch(0, n, 5_000 + n * 50_000, n, samples[n * 5 : n * 5 + 5])))
    result = _read(blank, [("x.sagittal-live", log)])
    (track,) = result["tracks"]
    assert result["segments"] == {"A1": "pelvis"}
    assert track["clock"] == "own"
    np.testing.assert_array_equal(_values(track, 0), samples[:, 0])
    np.testing.assert_array_equal(track["tUs"], 5_000 + 10_000 * np.arange(20))


def test_a_plain_table_of_ours_is_read(blank: Page) -> None:
    channels = [f"{kind}_{axis}" for kind in ("acc", "gyr") for axis in "xyz"]
    rows = [",".join(["t_s", *(f"{s}.{c}" for s in ("L_shank", "pelvis") for c in channels)])]
    rows += [",".join([f"{n / 60:.6f}", *(str(n + k / 10) for k in range(12))]) for n in range(30)]
    (track,) = _read(blank, [("walk.csv", "\n".join(rows).encode())])["tracks"]
    assert track["ids"] == ["L_shank", "pelvis"]
    assert abs(track["rateHz"] - 60) < 0.01
    np.testing.assert_allclose(_values(track, 1)[7, :6], 7 + np.arange(6, 12) / 10, rtol=1e-6)
    assert np.isnan(_values(track, 1)[:, 6:]).all()


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("notes.txt", b"no recording at all\n", "neither Xsens MT Manager text"),
        ("a.txt", b"PacketCounter,Acc_X,Acc_Y,Acc_Z\n1,0,0,9.8\n", "no angular rate"),
        ("b.txt", b"PacketCounter,FreeAcc_X,Gyr_X,Gyr_Y,Gyr_Z\n1,0,0,0,0\n", "acceleration with gravity"),
        ("c.csv", b"t_s,A.acc_x\n0,1\n1,2\n", "A.acc_y"),
        ("d.txt", b"PacketCounter,Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z\n1,0,0,9,0,0,0\n", "not say its rate"),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_played_is_refused_with_its_name(
    blank: Page, name: str, content: bytes, says: str
) -> None:
    result = run(
        blank,
        "capture/sources/files.js",
        "const file = new File([bytes(a.content)], a.name);"
        " return m.readFiles([file]).then(() => 'read', (e) => e.message);",
        {"name": name, "content": b64(content)},
    )
    assert name in result
    assert says in result


@pytest.mark.parametrize(
    ("name", "segment"),
    [
        ("L_shank", "shank_l"), ("RTibia", "shank_r"), ("LFemur", "thigh_l"), ("Right Foot", "foot_r"),
        ("Pelvis", "pelvis"), ("R_UpLeg", "thigh_r"), ("calcn_l_imu", "foot_l"), ("torso_imu", "chest"),
        ("00B40B91", None), ("Foot", None), ("Movella DOT", None),
    ],
)  # fmt: skip
def test_a_sensors_name_tells_its_segment(blank: Page, name: str, segment: str | None) -> None:
    assert run(blank, "capture/mapping.js", "return m.segmentInName(a);", name) == segment


def turned_device(
    order: str, sign: int, *, scale: float = 180 / np.pi, edge: float = 1.0
) -> list[list[float]]:
    """Rows (t, acc, rates) of a device laid flat, on its left edge (−1: right), upright and flat again.

    Truth: x right, y up the screen, z out of it; specific force +g along the upward axis.
    """
    dt, g = 1 / 60, np.array([0.0, 0.0, 9.81])
    quarter = np.pi / 2
    poses = [None, ("y", -quarter * edge), None, ("z", -quarter * edge), None, ("x", -quarter), None]
    rng = np.random.default_rng(5)
    rows, t = [], 0.0
    bias = np.array([0.01, -0.008, 0.005])
    for move in poses:
        n = 75
        w = np.zeros(3)
        if move is not None:
            w["xyz".index(move[0])] = move[1] / (n * dt)
        for _ in range(n):
            angle = np.linalg.norm(w) * dt
            if angle:  # a vector that stands still in the room, seen from the turning device
                k, a = w / np.linalg.norm(w), -angle
                g = g * np.cos(a) + np.cross(k, g) * np.sin(a) + k * (k @ g) * (1 - np.cos(a))
            read = dict(zip("xyz", (w + bias + rng.normal(0, 0.003, 3)) * scale, strict=True))
            rows.append([t, *(sign * (g + rng.normal(0, 0.03, 3))), *(read[axis] for axis in order)])
            t += dt
    return rows


SELF_TEST = """const test = new m.AxesTest(); const poses = [];
    for (const [t, x, y, z, ...rate] of a) if (test.push(t, [x, y, z], rate)) poses.push(test.still.length);
    return { poses, result: test.result, problem: test.problem };"""


@pytest.mark.parametrize("order", ["xyz", "zxy", "yxz"])
@pytest.mark.parametrize("sign", [1, -1])
def test_the_self_test_finds_axes_and_sign_from_gravity(blank: Page, order: str, sign: int) -> None:
    process = run(blank, "capture/sources/axes.js", SELF_TEST, turned_device(order, sign))
    assert process["problem"] is None
    assert process["poses"] == [1, 2, 3, 4]
    result = process["result"]
    assert result["accSign"] == sign
    assert [order[i] for i in result["order"]] == ["x", "y", "z"]
    assert result["signs"] == [1, 1, 1]
    assert result["scale"] == pytest.approx(np.pi / 180)
    assert result["errorDeg"] < 3


def test_the_self_test_finds_rates_in_radians_and_a_turned_sign(blank: Page) -> None:
    rows = turned_device("xyz", 1, scale=1.0)
    for row in rows:
        row[5] = -row[5]
    result = run(blank, "capture/sources/axes.js", SELF_TEST, rows)["result"]
    assert result["scale"] == 1
    assert result["signs"] == [1, -1, 1]


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda row: [*row[:4], 0.0, 0.0, 0.0], "do not match gravity"),
        (lambda row: [*row[:4], *(3 * r for r in row[4:])], "do not match gravity"),
        (lambda row: [row[0], *(0.3 * a for a in row[1:4]), *row[4:]], "excludes gravity"),
        (lambda row: [*row[:4], float("nan"), 0.0, 0.0], "no angular rate"),
    ],
)
def test_the_self_test_refuses_what_gravity_contradicts(blank: Page, spoil: Any, says: str) -> None:
    rows = [spoil(row) for row in turned_device("xyz", 1)]
    body = SELF_TEST.replace("of a)", "of a.map((row) => row.map((v) => v ?? NaN)))")
    result = run(blank, "capture/sources/axes.js", body, [[None if v != v else v for v in r] for r in rows])
    assert result["result"] is None
    assert says in result["problem"]


def test_the_self_test_refuses_the_wrong_edge(blank: Page) -> None:
    result = run(blank, "capture/sources/axes.js", SELF_TEST, turned_device("xyz", 1, edge=-1.0))
    assert result["result"] is None
    assert "was reversed" in result["problem"]
