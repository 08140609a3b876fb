"""Several detectors → one list of contacts, each with the fraction of detectors that found it.

Detectors define a contact by different moments (a zero crossing, a peak 50 ms later): the median offset of
each from the leading detector is removed first, then contacts within a window are merged. The lead's time is
used, so that a consensus is never less accurate than the lead where both found a contact. A detector that
abstained on a foot has no vote on it. All of this is our choice; validation/accuracy/test_events_consensus.py
measures it.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from sagittal.core.errors import Notice, ParameterError
from sagittal.core.events.detection import PITCH_RULE, detect
from sagittal.core.events.detection import SOURCE as REFINED
from sagittal.core.events.foot_pitch import FootPitchParams
from sagittal.core.events.gyro_peaks import LIMB, GyroPeakPresets, gyro_peak_events
from sagittal.core.events.result import EventKind, GaitEvent, GaitEvents
from sagittal.core.frames import FOOT, SIDES, Side
from sagittal.core.message import Message
from sagittal.core.plurals import plural

if TYPE_CHECKING:
    # the package brings numba, which readers of results do without
    from sagittal.core.fusion.orientations import Orientations

SOURCE: Final = "consensus"
KINDS: Final[tuple[EventKind, EventKind]] = ("ic", "tc")


@dataclass(frozen=True)
class ConsensusParams:
    """Combination of detectors.

    Parameters
    ----------
    presets : gyro-peak detectors used in addition to the foot-pitch rule: one for the foot, two for the
        shank.
    gyro_peaks : the rules of all selectable presets.
    window_s : contacts of one foot within this time, after removal of the median offset, are merged.
    pair_s, pairs : contacts of two detectors within this time contribute to the median offset, which needs
        this number of pairs.
    least : minimum fraction of votes for a contact; it must be exceeded without the lead's vote.
    shank_early_s : delay added to contacts led by a shank, which are 0.04 s early in neura_walk and 0.04 to
        0.10 s in simulated people (docs/science/events.md, "Shanks alone"). Foot-offs are not shifted: 0.05 s
        early in the former, 0.02 to 0.04 s late in the latter.
    shank_sd_s : standard uncertainty of both, measured there.

    Raises
    ------
    ParameterError : `unknown_detector`.
    """

    presets: tuple[str, ...] = ("mariani", "gouwanda", "catalfamo")
    window_s: float = 0.12
    pair_s: float = 0.25
    pairs: int = 3
    least: float = 0.5
    shank_early_s: float = 0.05
    shank_sd_s: float = 0.06
    gyro_peaks: GyroPeakPresets = field(default_factory=GyroPeakPresets)

    def __post_init__(self) -> None:
        detectors = self.gyro_peaks.by_name
        if unknown := [name for name in self.presets if name not in detectors]:
            raise ParameterError(
                "unknown_detector",
                Message(
                    "There is no detector '{unknown}'; expected one of {known}.",
                    unknown=unknown[0],
                    known=", ".join(detectors),
                ),
            )


_Sorted = Mapping[tuple[Side, EventKind], Sequence[GaitEvent]]
"""Events of one detector by foot and kind, in order of time."""


class _Vote(NamedTuple):
    detector: str
    time_s: float
    detected_s: float
    uncertainty_s: float | None


def all_detectors(
    orientations: Orientations,
    foot_pitch: FootPitchParams | None = None,
    params: ConsensusParams | None = None,
    refined: GaitEvents | None = None,
) -> dict[str, GaitEvents]:
    """Events of every detector whose sensors are available, the leading one of the feet first.

    Parameters
    ----------
    refined : result of `detect_contacts`, which then leads; None = the foot-pitch rule leads.
    """
    params = params or ConsensusParams()
    events_by_detector = (
        {PITCH_RULE: detect(orientations, foot_pitch)} if refined is None else {REFINED: refined}
    )
    presets = params.gyro_peaks.by_name
    for name in params.presets:
        preset = presets[name]
        if any(LIMB[preset.segment][side] in orientations.q for side in SIDES):
            events_by_detector[name] = gyro_peak_events(orientations, orientations.rate_hz, preset)
    return events_by_detector


def rate_confidence(
    events_by_detector: Mapping[str, GaitEvents], params: ConsensusParams | None = None
) -> GaitEvents:
    """The lead's contacts, unchanged in number, with the fraction of detectors that found each.

    Parameters
    ----------
    events_by_detector : detector → its events; the first leads. For a foot without other votes the confidence
        remains None.

    Returns
    -------
    The lead's events and notices; `others_found_contacts` if the lead abstained and two others did not.
    """
    params = params or ConsensusParams()
    name, lead = next(iter(events_by_detector.items()))
    notices = list(lead.notices)
    own = _sort_all(events_by_detector)
    shares: dict[tuple[Side, EventKind, float], float] = {}
    for side in SIDES:
        voters = _voters(own, side)
        if name not in voters and len(voters) >= 2:
            notices.append(_others(side, voters))
        if name not in voters or len(voters) < 2:
            continue
        for kind in KINDS:
            for votes in _clusters(voters, side, kind, params):
                # a cluster begins with the lead's contact where it has one
                if votes[0].detector == name:
                    shares[side, kind, votes[0].time_s] = len(votes) / len(voters)
    events = tuple(e.rate(shares.get((e.side, e.kind, e.time_s))) for e in lead.events)
    return replace(lead, events=events, notices=tuple(notices))


def agree_on_contacts(
    events_by_detector: Mapping[str, GaitEvents], params: ConsensusParams | None = None
) -> GaitEvents:
    """Contacts that enough detectors agree on.

    Parameters
    ----------
    events_by_detector : detector → its events, all for one recording; the first leads.

    Returns
    -------
    Events with `confidence`, the fraction of detectors that did not abstain on the foot. The lead's notices
    are kept; `led_by_other` reports a foot on which the lead abstained and others agreed,
    `detectors_disagree` the number of contacts of a foot that only few detectors found.
    """
    params = params or ConsensusParams()
    lead = next(iter(events_by_detector))
    events: list[GaitEvent] = []
    notices = list(events_by_detector[lead].notices)
    own = _sort_all(events_by_detector)
    for side in SIDES:
        voters = _voters(own, side)
        if not voters:
            continue
        leads = next(iter(voters))
        if leads != lead:
            notices.append(_led_by_other(side, leads, voters))
        dropped = 0
        preset = params.gyro_peaks.by_name.get(leads)
        shank = preset is not None and preset.segment == "shank"
        for kind in KINDS:
            for votes in _clusters(voters, side, kind, params):
                share = len(votes) / len(voters)
                led = votes[0] if votes[0].detector == leads else None
                if share < params.least or (led is None and share <= params.least):
                    dropped += 1
                    continue
                time = led.time_s if led is not None else float(np.median([v.time_s for v in votes]))
                detection_s = max(v.detected_s for v in votes)
                sd = None if led is None else led.uncertainty_s
                if shank:
                    time += params.shank_early_s if kind == "ic" else 0.0
                    sd = params.shank_sd_s
                events.append(GaitEvent(time, side, kind, SOURCE, max(detection_s, time), share, sd))
        if dropped:
            notices.append(_disagree(side, dropped, len(voters)))
    events.sort(key=lambda e: (e.time_s, e.side, e.kind))
    return GaitEvents(tuple(events), tuple(notices), {"detectors": tuple(events_by_detector)})


def _sort_all(events_by_detector: Mapping[str, GaitEvents]) -> dict[str, _Sorted]:
    """Detector → its events by foot and kind."""
    every: dict[str, _Sorted] = {}
    for name, events in events_by_detector.items():
        own: dict[tuple[Side, EventKind], list[GaitEvent]] = {(s, k): [] for s in SIDES for k in KINDS}
        for event in events.events:
            own[event.side, event.kind].append(event)
        every[name] = own
    return every


def _voters(sorted_events: Mapping[str, _Sorted], side: Side) -> dict[str, _Sorted]:
    """Detectors that found contacts of a foot, in their order."""
    return {name: own for name, own in sorted_events.items() if own[side, "ic"]}


def _clusters(
    voters: Mapping[str, _Sorted], side: Side, kind: EventKind, params: ConsensusParams
) -> list[list[_Vote]]:
    """Contacts to be merged, with at most one vote per detector, in chronological order."""
    lead, *followers = voters
    reference = [e.time_s for e in voters[lead][side, kind]]
    clusters = [[v] for v in _votes(lead, voters[lead][side, kind])]
    for name in followers:
        times = [c[0].time_s for c in clusters]
        used_clusters: set[int] = set()
        free = []
        for vote in _moved(_votes(name, voters[name][side, kind]), reference, params):
            first = bisect_left(times, vote.time_s - params.window_s)
            end = bisect_right(times, vote.time_s + params.window_s)
            near = [(abs(times[i] - vote.time_s), i) for i in range(first, end) if i not in used_clusters]
            if near:
                index = min(near)[1]
                used_clusters.add(index)
                clusters[index].append(vote)
            else:
                free.append([vote])
        clusters = sorted(clusters + free, key=lambda c: c[0].time_s)
    return clusters


def _votes(name: str, events: Sequence[GaitEvent]) -> list[_Vote]:
    return [_Vote(name, e.time_s, e.detected_s, e.uncertainty_s) for e in events]


def _moved(votes: list[_Vote], lead: Sequence[float], params: ConsensusParams) -> list[_Vote]:
    """Votes after removal of the median offset of their detector from the lead's contacts, which are
    sorted.
    """
    if not lead or not votes:
        return votes
    reference, times = np.array(lead), np.array([v.time_s for v in votes])
    next_index = np.clip(np.searchsorted(reference, times), 0, len(reference) - 1)
    previous_index = np.maximum(next_index - 1, 0)
    nearer = np.abs(reference[previous_index] - times) <= np.abs(reference[next_index] - times)
    off = times - reference[np.where(nearer, previous_index, next_index)]
    off = off[np.abs(off) <= params.pair_s]
    if len(off) < params.pairs:
        return votes
    apart = float(np.median(off))
    return [_Vote(v.detector, v.time_s - apart, v.detected_s, v.uncertainty_s) for v in votes]


def _others(side: Side, voters: Mapping[str, _Sorted]) -> Notice:
    counts = ", ".join(f"{name} {len(own[side, 'ic'])}" for name, own in voters.items())
    return Notice(
        "others_found_contacts",
        Message(
            "Other detectors found contacts of the {side} foot ({counts}). The analysis can be run with "
            "the consensus of all detectors instead; check its contacts against the signals.",
            side=side,
            counts=counts,
        ),
        FOOT[side],
        severity="info",
    )


def _led_by_other(side: Side, leads: str, voters: Mapping[str, _Sorted]) -> Notice:
    return Notice(
        "led_by_other",
        Message(
            "No contacts of the {side} foot were detected from a foot sensor. They come from {leads} "
            + ("and {others} more" if len(voters) > 1 else "alone")
            + " (reconstructions of published detectors), about 0.06 s from those of a foot sensor. "
            "Check them against the signals, and compare stance, swing and support only with trials "
            "using the same sensors.",
            side=side,
            leads=leads,
            others=len(voters) - 1,
        ),
        FOOT[side],
    )


def _disagree(side: Side, dropped: int, n: int) -> Notice:
    return Notice(
        "detectors_disagree",
        plural(
            dropped,
            Message(
                "{dropped} possible contact of the {side} foot was detected by too few of {value} detectors "
                "and is excluded.",
                dropped=dropped,
                side=side,
                value=n,
            ),
            Message(
                "{dropped} possible contacts of the {side} foot were detected by too few of {value} "
                "detectors and are excluded.",
                dropped=dropped,
                side=side,
                value=n,
            ),
        ),
        FOOT[side],
        severity="info",
    )
