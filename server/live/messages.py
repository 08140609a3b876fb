"""What web process and estimator process say to each other: MessagePack over a socket pair, not pickle.

The samples are not among it: the estimator reads them from the take's log, whose new length it is told.
"""

from __future__ import annotations

from functools import partial
from typing import Any, Final, Literal

import msgspec

from sagittal.core.user_text import encode_user_text

STALE_S: Final = 0.5
"""Data older than this are not fed back (docs/science/feedback.md, "Which strides get a cue")."""

BATTERY_WARN_PCT: Final = 15.0
"""Our choice: a DOT streams 6 h, so there is about an hour left."""

Kind = Literal["stride", "cue", "calibration", "guard", "notice"]


class Command(msgspec.Struct, frozen=True, tag=True):
    """Web to estimator: a therapist's command, valid from the batch `before` on, in a replay too."""

    take: str
    before: int
    name: str
    value: Any = None


class FollowTake(msgspec.Struct, frozen=True, tag=True):
    """Web to estimator: follow this take from the start of its log.

    Parameters
    ----------
    size : bytes of the log that were there before; what comes out of them is late.
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
    """Web to estimator: logs have so many bytes now; `at` = monotonic time of the newest."""

    sizes: dict[str, int]
    at: float


class Charge(msgspec.Struct, frozen=True, tag=True):
    """Web to estimator: battery of sensors in percent, to be shown."""

    take: str
    percent: dict[str, float]


class ForgetTake(msgspec.Struct, frozen=True, tag=True):
    """Web to estimator: forget this take."""

    take: str


class EstimatorReady(msgspec.Struct, frozen=True, tag=True):
    """Estimator to web: everything is imported and compiled."""


class FigurePose(msgspec.Struct, frozen=True, tag=True):
    """The figure at one moment: float32 q (n, 4) and p (n, 3) of the named segments, as `LiveFrame`."""

    segments: list[str]
    q: bytes
    p: bytes
    valid: bool
    contact: dict[str, bool]


class Picture(msgspec.Struct, frozen=True, tag=True):
    """Estimator to web: the newest state of a take; an older one that was not sent yet is worth nothing.

    Parameters
    ----------
    t_s, seq, stage : as `LiveFrame`. body : JSON object for the browsers, without its closing brace.
    delay_s : from when its last sample was due to when this was said. size : bytes of the log it has seen.
    say : what the person of a guided test does now.
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
    """Estimator to web: something that happens once, the `k`th of its kind; a replay says it again.

    Parameters
    ----------
    body : JSON object for the browsers. late : it came out of samples that are no longer fresh.
    """

    take: str
    kind: Kind
    k: int
    t_s: float | None
    body: bytes
    late: bool


class FeedbackStatus(msgspec.Struct, frozen=True, tag=True):
    """Estimator to web: where the feedback stands, JSON for the browsers."""

    take: str
    body: bytes


class LogProcessed(msgspec.Struct, frozen=True, tag=True):
    """Estimator to web: the log has its end, and everything before it has been told."""

    take: str


class EstimateFailed(msgspec.Struct, frozen=True, tag=True):
    """Estimator to web: this take cannot be estimated any further; it is recorded all the same."""

    take: str
    code: str
    message: str


Order = FollowTake | LogGrown | Command | Charge | ForgetTake
Report = EstimatorReady | Picture | FeedItem | FeedbackStatus | LogProcessed | EstimateFailed

encode = partial(msgspec.msgpack.encode, enc_hook=encode_user_text)
decode_order = msgspec.msgpack.Decoder(Order).decode
decode_report = msgspec.msgpack.Decoder(Report).decode
