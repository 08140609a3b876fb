"""Every message a tablet can send has a defined answer."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from typing import Any
from zlib import crc32

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sagittal.core.formats.live_log import Finish, Hello, decode_batch, hello_json
from sagittal.server.live import protocol
from sagittal.server.live.intake import MISMATCH, Intake, IntakeAnswer
from sagittal.server.live.protocol import FINAL, MAX_UNACKED, MOST_UNACKED, CloseCode, ProtocolError, parse
from tests.helpers.live_takes import HELLO, digest, finish_text, frame

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda x: st.lists(x, max_size=4) | st.dictionaries(st.text(max_size=8), x, max_size=4),
    max_leaves=12,
)


def greeted(batches: int = 0, synced: bool = True) -> Intake:
    intake = Intake()
    intake.greet(HELLO)
    for seq in range(batches):
        assert intake.offer(frame(seq)).close is None
    if synced:
        intake.note_synced(batches)
    return intake


def said(answer: IntakeAnswer) -> dict[str, Any]:
    assert answer.say is not None
    return dict(json.loads(answer.say))


def resealed(whole: bytes, change: Callable[[bytearray], None]) -> bytes:
    """Modified frame with a valid checksum: a faulty client, not a transmission error."""
    body = bytearray(whole[:-4])
    change(body)
    return bytes(body) + struct.pack("<I", crc32(bytes(body)))


def test_a_first_hello_is_welcomed_with_batch_zero() -> None:
    assert said(Intake().greet(HELLO)) == {"type": "welcome", "next_seq": 0, "max_unacked": MAX_UNACKED}


def test_the_same_hello_with_another_token_resumes() -> None:
    second = parse(hello_json(HELLO, "another").decode())
    assert isinstance(second, Hello)
    assert said(greeted(5).greet(second))["next_seq"] == 5


def test_a_welcome_promises_only_what_is_durable() -> None:
    intake = greeted(3)
    intake.offer(frame(3))
    assert said(intake.greet(HELLO))["next_seq"] == 3
    assert said(intake.offer(frame(3))) == {"type": "ack", "ack": 3}
    assert intake.offer(frame(4)).keep is not None


@pytest.mark.parametrize("changed", ["take", "rate", "segment", "sensor"])
def test_a_changed_hello_is_refused(changed: str) -> None:
    root = json.loads(hello_json(HELLO))
    match changed:
        case "take":
            root["take"] = "other"
        case "rate":
            root["streams"][0]["rate_hz"] = 60.0
        case "segment":
            root["streams"][0]["sensors"][0]["segment"] = None
        case "sensor":
            root["streams"][1]["sensors"].append({"id": "C", "segment": None})
    second = parse(json.dumps(root))
    assert isinstance(second, Hello)
    answer = greeted(2).greet(second)
    assert (answer.close, answer.reason) == (CloseCode.MALFORMED, "hello_changed")
    assert said(answer)["code"] == "hello_changed"


def test_a_hello_in_the_middle_of_the_stream_is_answered_like_the_first() -> None:
    assert said(greeted(3).offer(hello_json(HELLO, "t").decode()))["next_seq"] == 3


def test_the_next_batch_is_kept_as_received() -> None:
    whole = frame(0)
    assert greeted().offer(whole) == IntakeAnswer(keep=("B", whole))


def test_a_duplicate_is_ignored_and_the_last_acknowledgement_repeated() -> None:
    intake = greeted(3)
    intake.offer(frame(3))
    answer = intake.offer(frame(1))
    assert (said(answer), answer.keep, answer.close) == ({"type": "ack", "ack": 3}, None, None)
    assert intake.next_seq == 4


def test_a_reordered_batch_is_a_gap_and_closes_with_resume() -> None:
    intake = greeted(3)
    answer = intake.offer(frame(4))
    assert (answer.close, answer.reason, answer.keep) == (CloseCode.GAP, "gap", None)
    assert CloseCode.GAP not in FINAL
    assert intake.offer(frame(3)).keep is not None


def test_a_batch_before_any_hello_is_refused() -> None:
    assert Intake().offer(frame(0)).reason == "hello_missing"


@pytest.mark.parametrize(
    ("damage", "code"),
    [
        (lambda f: f[:-1], "batch_shape"),
        (lambda f: f + b"\0", "batch_shape"),
        (lambda f: b"", "batch_shape"),
        (lambda f: b"XGL1" + f[4:], "batch_magic"),
        (lambda f: f[:60] + bytes([f[60] ^ 1]) + f[61:], "batch_checksum"),
        (lambda f: resealed(f, lambda b: b.__setitem__(10, 9)), "batch_stream"),
        (lambda f: resealed(f, lambda b: b.__setitem__(10, 3)), "batch_shape"),
        (lambda f: resealed(f, lambda b: b.__setitem__(4, 2)), "batch_shape"),
        (lambda f: resealed(f, lambda b: b.__setitem__(19, 255)), "batch_time"),
    ],
)
def test_a_malformed_batch_closes_with_its_reason(damage: Callable[[bytes], bytes], code: str) -> None:
    intake = greeted(1)
    answer = intake.offer(damage(frame(1)))
    assert (answer.close, answer.reason, answer.keep) == (CloseCode.MALFORMED, code, None)
    assert said(answer)["detail"]
    assert intake.next_seq == 1


@pytest.mark.parametrize("message", [b"\0" * ((1 << 20) + 1), " " * ((1 << 20) + 1)])
def test_an_oversized_message_closes_as_too_big(message: bytes | str) -> None:
    answer = greeted().offer(message)
    assert (answer.close, answer.reason) == (CloseCode.TOO_BIG, "message_too_big")


def test_values_that_cannot_be_measured_are_kept() -> None:
    whole = resealed(frame(0), lambda b: b.__setitem__(slice(36, 44), struct.pack("<ff", np.inf, 1e30)))
    assert greeted().offer(whole).keep == ("B", whole)


def test_clocks_that_jump_change_nothing_in_the_order() -> None:
    intake = greeted()
    for seq, (t0, sent) in enumerate([(5, 5), (1 << 52, 0), (0, 1 << 52), (0, 0)]):
        whole = resealed(frame(seq), lambda b, t0=t0, sent=sent: struct.pack_into("<QQ", b, 20, t0, sent))  # type: ignore[misc]
        assert intake.offer(whole).keep == ("B", whole)
    assert intake.next_seq == 4


def test_a_tablet_that_does_not_wait_for_acknowledgements_is_closed() -> None:
    intake = greeted(MOST_UNACKED, synced=False)
    answer = intake.offer(frame(MOST_UNACKED))
    assert (answer.close, answer.reason) == (CloseCode.TOO_MANY, "too_many_unacked")
    intake.note_synced(1)
    assert intake.offer(frame(MOST_UNACKED)).keep is not None


def test_a_json_batch_is_kept_in_binary_form() -> None:
    batch = decode_batch(frame(3))
    root = {
        "type": "batch", "stream": 3, "seq": 0, "t0_us": batch.t0_us, "sent_us": 7,
        "samples": [[[None if np.isnan(v) else float(v) for v in s] for s in row] for row in batch.samples],
        "offsets_us": [int(x) for x in batch.offsets_us] if batch.offsets_us is not None else None,
    }  # fmt: skip
    answer = greeted().offer(json.dumps(root))
    assert answer.keep is not None
    second_batch = decode_batch(answer.keep[1])
    assert (second_batch.stream, second_batch.seq, second_batch.sent_us) == (3, 0, 7)
    np.testing.assert_array_equal(second_batch.samples, batch.samples)
    np.testing.assert_array_equal(second_batch.offsets_us, batch.offsets_us)


def test_battery_is_handed_on_and_not_kept() -> None:
    intake = greeted(1)
    answer = intake.offer('{"type":"battery","sensors":{"A1":80,"B1":7.5}}')
    assert answer == IntakeAnswer(battery={"A1": 80.0, "B1": 7.5})
    assert intake.next_seq == 1


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("", "message_bad_json"),
        ("{", "message_bad_json"),
        ("[" * 100_000, "message_bad_json"),
        ('{"type":"battery","type":"battery"}', "message_bad_json"),
        ('{"type":"batch","samples":[[[NaN]]]}', "message_bad_json"),
        ("[]", "message_unknown"),
        ("null", "message_unknown"),
        ('{"type":"ack","ack":3}', "message_unknown"),
        ('{"type":["hello"]}', "message_unknown"),
        ('{"type":"hello"}', "hello_protocol"),
        ('{"type":"hello","protocol":"sagittal.live.v1","take":"t"}', "hello_bad_value"),
        (json.dumps(json.loads(hello_json(HELLO)) | {"take": "\ud800"}), "message_bad_json"),
        ('{"type":"batch"}', "batch_shape"),
        ('{"type":"batch","stream":0,"seq":0,"t0_us":0,"sent_us":0,"samples":[[1,2]]}', "batch_shape"),
        ('{"type":"finish"}', "finish_bad"),
        ('{"type":"finish","count":-1,"sha256":"' + "0" * 64 + '"}', "finish_bad"),
        ('{"type":"battery"}', "battery_bad"),
        ('{"type":"battery","sensors":{"A1":101}}', "battery_bad"),
        ('{"type":"battery","sensors":{"A1":"full"}}', "battery_bad"),
    ],
)
def test_a_malformed_text_message_closes_with_its_reason(text: str, code: str) -> None:
    answer = greeted().offer(text)
    assert (answer.close, answer.reason) == (CloseCode.MALFORMED, code)
    with pytest.raises(ProtocolError) as refused:
        parse(text)
    assert refused.value.code == code


@given(st.text() | JSON.map(json.dumps))
def test_no_text_breaks_the_rules(text: str) -> None:
    answer = greeted().offer(text)
    assert answer.close is None or answer.say


@pytest.mark.slow
@given(
    st.sampled_from(["hello", "batch", "finish", "battery"]),
    st.dictionaries(
        st.sampled_from(
            ["protocol", "take", "source", "streams", "samples", "seq", "stream", "sensors", "count"]
        ),
        JSON | st.just("sagittal.live.v1"),
    ),
)
def test_no_half_right_message_breaks_the_rules(kind: str, rest: dict[str, Any]) -> None:
    answer = greeted().offer(json.dumps({"type": kind, **rest}))
    assert answer.close is None or answer.say


@given(st.binary(max_size=200) | st.binary(max_size=60).map(lambda b: frame(0)[:36] + b))
def test_no_bytes_break_the_rules(data: bytes) -> None:
    answer = greeted().offer(data)
    assert answer.close is not None
    assert answer.keep is None


def test_a_finish_that_fits_is_kept_and_ends_the_take_once_it_is_durable() -> None:
    frames = [frame(i) for i in range(3)]
    intake = greeted(3)
    answer = intake.offer(finish_text(frames))
    assert answer.keep is not None
    assert (answer.keep[0], answer.say, intake.is_over, intake.ended) == ("F", None, True, None)
    intake.note_synced(4)
    assert intake.ended is not None
    assert (intake.ended.count, intake.ended.sha256, intake.ended.problem) == (3, digest(frames), None)


def test_a_finish_is_answered_again_with_the_same_end() -> None:
    frames = [frame(i) for i in range(3)]
    intake = greeted(3)
    intake.offer(finish_text(frames))
    assert intake.offer(finish_text(frames)) == IntakeAnswer()  # not durable yet: the answer follows
    intake.note_synced(4)
    assert intake.offer(finish_text(frames)) == IntakeAnswer(ended=intake.ended)
    assert said(intake.greet(HELLO))["next_seq"] == 3


def test_a_finish_that_counts_more_asks_for_the_rest_and_the_take_goes_on() -> None:
    intake = greeted(3)
    answer = intake.offer(finish_text([frame(i) for i in range(5)]))
    assert (said(answer)["code"], said(answer)["next_seq"], answer.close) == (MISMATCH, 3, None)
    assert intake.offer(frame(3)).keep is not None


@pytest.mark.parametrize("finish", [Finish(3, "0" * 64), Finish(2, digest([frame(0), frame(1)]))])
def test_a_finish_with_another_hash_or_fewer_batches_keeps_the_take_and_marks_it(finish: Finish) -> None:
    intake = greeted(3)
    answer = intake.offer(json.dumps({"type": "finish", "count": finish.count, "sha256": finish.sha256}))
    assert answer.keep is not None
    intake.note_synced(4)
    assert intake.ended is not None
    assert (intake.ended.count, intake.ended.problem) == (3, MISMATCH)
    assert intake.ended.sha256 == digest([frame(i) for i in range(3)])


def test_after_the_end_new_batches_are_refused_and_old_ones_acknowledged() -> None:
    intake = greeted(3)
    intake.end()
    answer = intake.offer(frame(3))
    assert (answer.close, answer.reason) == (CloseCode.ENDED, "take_ended")
    assert said(intake.offer(frame(2))) == {"type": "ack", "ack": 3}


def test_the_server_can_end_a_take_with_its_own_count() -> None:
    intake = greeted(2)
    assert intake.end().keep is not None
    intake.note_synced(3)
    assert intake.ended is not None
    assert intake.ended.problem is None
    assert intake.end() == IntakeAnswer(ended=intake.ended)


def test_what_the_server_says_is_plain_json() -> None:
    assert json.loads(protocol.ack(7)) == {"type": "ack", "ack": 7}
    assert json.loads(protocol.command("start")) == {"type": "command", "command": "start"}
    assert json.loads(protocol.announce_finish("r")) == {"type": "finished", "recording": "r"}
