"""What every live estimator takes and gives: a block of samples in, a block of the body out."""

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
    turned : segment → (T, 4) to W by its sensor alone (`AttitudeTracker`), of
        `LivePoseEstimator.attitudes` and the feet. filled : (T, n) lost, a straight line instead.
    """

    acc: Floats
    gyr: Floats
    valid: Bools
    turned: Mapping[Segment, Floats]
    filled: Bools


class FootBlock(NamedTuple):
    """A block of the feet: p (T, F, 3), q (T, F, 4), still, valid, patched (T, F), as `FootTracks`."""

    p: Floats
    q: Floats
    still: Bools
    valid: Bools
    patched: Bools


class BodyBlock(NamedTuple):
    """A block of the body.

    Parameters
    ----------
    q, p : (T, S, 4), (T, S, 3) of the estimator's segments, p NaN where it gives no place. known : (T, S) the
        orientation means something. whole : (T,) the figure does.
    paths : of the feet that carry a sensor.
    """

    q: Floats
    p: Floats
    known: Bools
    whole: Bools
    paths: FootBlock


class LivePoseEstimator(Protocol):
    """What turns signals into a body.

    segments : of `BodyBlock`. attitudes : segments whose orientation by their sensor alone it wants.
    linked, source : as in `FootTracks`. broken : it gave up.
    """

    method: LiveMethod
    segments: tuple[Segment, ...]
    attitudes: tuple[Segment, ...]
    linked: bool
    source: str

    @property
    def broken(self) -> bool:
        """Whether a filter gave up."""

    def push(self, raw: MeasuredBlock) -> BodyBlock:
        """The next samples; the first block is the whole standing window."""

    def drain_notices(self) -> list[Notice]:
        """What is new to be said of itself."""


def list_worn_feet(segments: Iterable[Segment]) -> tuple[Segment, ...]:
    """Feet among these segments, left first."""
    worn = set(segments)
    return tuple(FOOT[s] for s in SIDES if FOOT[s] in worn)
