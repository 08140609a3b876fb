"""Interface of the live estimators: a block of samples in, a block of body poses out."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple, Protocol

from sagittal.core.errors import Notice
from sagittal.core.estimators import LiveMethod
from sagittal.core.frames import FOOT, SIDES, Bools, Floats, Segment


class MeasuredBlock(NamedTuple):
    """A block as measured: acc, gyr (T, n, 3), valid (T, n) of the chain's sensors.

    Parameters
    ----------
    turned : segment → (T, 4) to W from its sensor alone (`AttitudeTracker`), for
        `LivePoseEstimator.attitudes` and the feet. filled : (T, n) lost samples, linearly interpolated.
    """

    acc: Floats
    gyr: Floats
    valid: Bools
    turned: Mapping[Segment, Floats]
    filled: Bools


class FootBlock(NamedTuple):
    """A block of foot data: p (T, F, 3), q (T, F, 4), still, valid, patched (T, F), as `FootTracks`."""

    p: Floats
    q: Floats
    still: Bools
    valid: Bools
    patched: Bools


class BodyBlock(NamedTuple):
    """A block of body poses.

    Parameters
    ----------
    q, p : (T, S, 4), (T, S, 3) of the estimator's segments, p NaN if it gives no position. known : (T, S) the
        orientation is valid. whole : (T,) the complete pose is valid.
    paths : of the feet with a sensor.
    """

    q: Floats
    p: Floats
    known: Bools
    whole: Bools
    paths: FootBlock


class LivePoseEstimator(Protocol):
    """Estimator of body poses from signals.

    segments : of `BodyBlock`. attitudes : segments whose single-sensor orientation is required as input.
    linked, source : as in `FootTracks`. broken : it has failed.
    """

    method: LiveMethod
    segments: tuple[Segment, ...]
    attitudes: tuple[Segment, ...]
    linked: bool
    source: str

    @property
    def broken(self) -> bool:
        """Whether a filter has failed."""

    def push(self, raw: MeasuredBlock) -> BodyBlock:
        """Process the next samples; the first block is the whole standing window."""

    def drain_notices(self) -> list[Notice]:
        """New notices."""


def list_worn_feet(segments: Iterable[Segment]) -> tuple[Segment, ...]:
    """Feet among these segments, left first."""
    instrumented = set(segments)
    return tuple(FOOT[s] for s in SIDES if FOOT[s] in instrumented)
