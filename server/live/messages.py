"""Messages between web and estimator processes: MessagePack over a socket pair, not pickle.

Samples are not transmitted: the estimator reads them from the log, of which it receives the current size.
"""

from __future__ import annotations

from functools import partial
from typing import Any, Final, Literal

import msgspec

from sagittal.core.user_text import encode_user_text

STALE_S: Final = 0.5
"""Older data are not used for feedback (docs/science/feedback.md, "Which strides get a cue")."""

BATTERY_WARN_PCT: Final = 15.0
"""Our choice: a DOT streams for 6 h, so about one hour is left."""

Kind = Literal["stride", "cue", "calibration", "guard", "notice"]


class Command(msgspec.Struct, frozen=True, tag=True):
    """Web to estimator: a therapist's command, effective from the batch `before`, also in a replay."""

    take: str
    before: int
    name: str
    value: Any = None


class FollowTake(msgspec.Struct, frozen=True, tag=True):
    """Web to estimator: process this trial from the start of its log.

    Parameters
    ----------
    size : existing bytes of the log; results from them are marked late.
    prescription, baseline : JSON of sagittal.core.feedback, None = no feedback. commands : given so far.
    """

    take: str
    path: str
    size: int
    height_m: float | None
    protocol: str
    prescription: dict[str, Any] | None
    baseline: dict[str, Any] | None
    commands: list[Command]


class LogGrown(msgspec.Struct, frozen=True, tag=True):
    """Web to estimator: current sizes of logs; `at` = monotonic time of the latest data."""

    sizes: dict[str, int]
    at: float


class Charge(msgspec.Struct, frozen=True, tag=True):
    """Web to estimator: battery levels of sensors in percent, for display."""

    take: str
    percent: dict[str, float]


class ForgetTake(msgspec.Struct, frozen=True, tag=True):
    """Web to estimator: stop processing this trial."""

    take: str


class EstimatorReady(msgspec.Struct, frozen=True, tag=True):
    """Estimator to web: all modules are imported and compiled."""


class FigurePose(msgspec.Struct, frozen=True, tag=True):
    """Pose of the avatar at one time: float32 q (n, 4) and p (n, 3) of the named segments, as `LiveFrame`."""

    segments: list[str]
    q: bytes
    p: bytes
    valid: bool
    contact: dict[str, bool]


class Picture(msgspec.Struct, frozen=True, tag=True):
    """Estimator to web: latest state of a trial; supersedes an older one not yet sent.

    Parameters
    ----------
    t_s, seq, stage : as `LiveFrame`. body : JSON object for the browsers, without its closing brace.
    delay_s : from the due time of its last sample to transmission. size : bytes of the log processed.
    say : current instruction of a guided test.
    """

    take: str
    t_s: float
    seq: int
    stage: str
    body: bytes
    delay_s: float | None
    size: int
    pose: FigurePose | None
    say: str | None = None


class FeedItem(msgspec.Struct, frozen=True, tag=True):
    """Estimator to web: a one-time event, the `k`th of its kind; repeated in a replay.

    Parameters
    ----------
    body : JSON object for the browsers. late : computed from delayed samples.
    """

    take: str
    kind: Kind
    k: int
    t_s: float | None
    body: bytes
    late: bool


class FeedbackStatus(msgspec.Struct, frozen=True, tag=True):
    """Estimator to web: state of the feedback, JSON for browsers."""

    take: str
    body: bytes


class LogProcessed(msgspec.Struct, frozen=True, tag=True):
    """Estimator to web: the log is complete and all its results have been sent."""

    take: str


class EstimateFailed(msgspec.Struct, frozen=True, tag=True):
    """Estimator to web: estimation of this trial failed; it is still recorded."""

    take: str
    code: str
    message: str


Order = FollowTake | LogGrown | Command | Charge | ForgetTake
Report = EstimatorReady | Picture | FeedItem | FeedbackStatus | LogProcessed | EstimateFailed

encode = partial(msgspec.msgpack.encode, enc_hook=encode_user_text)
encode_json = partial(msgspec.json.encode, enc_hook=encode_user_text)
decode_order = msgspec.msgpack.Decoder(Order).decode
decode_report = msgspec.msgpack.Decoder(Report).decode
