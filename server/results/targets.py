"""Numeric targets of biofeedback: norm at the patient's speed, the other side, or the own baseline."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import Final

from sqlalchemy import Connection

from sagittal.core.feedback import Target
from sagittal.core.feedback.prescription import TargetSource
from sagittal.core.frames import SIDES, Side
from sagittal.core.message import Message
from sagittal.core.norms import Norms, NormValue
from sagittal.core.norms.values import is_angle
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.parameters.result import Parameter
from sagittal.core.plurals import plural
from sagittal.core.subject.condition import is_alike
from sagittal.server.clinic.patients import Patient
from sagittal.server.clinic.sessions import WALKS, Session
from sagittal.server.report.history.numbers import Numbers
from sagittal.server.report.words.wording import GROUPS, NO_NORM
from sagittal.server.results import comparisons, controls, histories
from sagittal.server.results.histories import AnalysedSession
from sagittal.server.results.reviewed import ReviewedAnalyses
from sagittal.web.words import day

FEWEST: Final = 5
"""Minimum number of strides for using a patient's own mean and SD as a target (our choice)."""


@dataclass(frozen=True, eq=False)
class AnalysedWalk:
    """An analysed session with its norms.

    Parameters
    ----------
    own_controls : the clinic's own norm, read on demand as there may be many controls.
    """

    session: Session
    numbers: Numbers
    norms: Norms
    own_controls: Callable[[], Norms | None]


@dataclass(frozen=True)
class Offer:
    """Target from a source, or a sentence with the reason why there is none."""

    target: Target | None
    reason: str | None = None


def last_walk(
    c: Connection,
    reviewed: ReviewedAnalyses,
    patient: Patient,
    reference: Session | None = None,
    session_id: str | None = None,
    *,
    with_controls: bool = True,
) -> AnalysedWalk | None:
    """The latest walk without feedback that represents the patient's gait; None without one.

    Without `reference`, as selected by `histories.baseline`.

    Parameters
    ----------
    reference : the newest under the condition of this session, on its day or earlier, excluding itself.
    session_id : only this one. with_controls : include the clinic's own controls.
    """
    candidates = [
        a
        for a in histories.list_analysed(c, patient.id)
        if a.session.protocol in WALKS
        and session_id in {None, a.session.id}
        and (reference is None or _earlier(a, reference))
    ]
    last = histories.baseline(candidates)
    if last is None:
        return None
    numbers = reviewed.read_numbers(last.found, last.edits)
    speed = _mean(numbers, "gait_speed_mps", None)
    visits = controls.list_visits(c, patient, last.session) if with_controls else ()

    def own_controls() -> Norms | None:
        group = controls.make_group(reviewed, visits, None if speed is None else speed.mean)
        return None if group is None or speed is None else group.norms(speed.mean)

    return AnalysedWalk(
        last.session, numbers, comparisons.find_norms(patient, last.session, numbers), own_controls
    )


def offer(walk: AnalysedWalk | None, source: TargetSource, parameter: str, side: Side | None) -> Offer:
    """Target of a parameter from a source, based on a patient's last walk.

    Parameters
    ----------
    side : trained side, None = both.
    """
    if source == "manual":
        return Offer(None, "Enter mean and SD.")
    if walk is None:
        return Offer(
            None,
            "No walk without feedback has been analysed for this person yet. Analyse one first, or enter "
            "a target.",
        )
    if source == "norm":
        return _norm(walk, parameter)
    if source == "own_baseline":
        return _own(walk, parameter, side)
    if side is None:
        return Offer(
            None, "Both sides are selected for training. Choose one side; the other is then the target."
        )
    return _better(walk, parameter, side)


def opposite_side(side: Side) -> Side:
    """The opposite side."""
    return "right" if side == "left" else "left"


def find_usual_value(walk: AnalysedWalk, parameter: str, side: Side | None) -> Parameter | None:
    """Value of a parameter in a walk, of one side or both together; None if it was not measured."""
    usual = _mean(walk.numbers, parameter, side) or _mean(walk.numbers, parameter, None)
    if usual is not None or side is not None:
        return usual
    sides = [p for s in SIDES if (p := _mean(walk.numbers, parameter, s)) is not None]
    return _together(sides) if sides else None


def _better(walk: AnalysedWalk, parameter: str, side: Side) -> Offer:
    """The other side's value, if it is the better one according to the parameter's direction."""
    entry = CATALOGUE[parameter]
    if entry.better is None:
        return Offer(
            None,
            Message(
                "{label}: neither higher nor lower is better by itself. Choose another source, or "
                "enter a target.",
                label=entry.label,
            ),
        )
    opposite = _own(walk, parameter, opposite_side(side))
    own = find_usual_value(walk, parameter, side)
    if opposite.target is None or opposite.target.mean is None or own is None or own.mean is None:
        return opposite
    ahead = opposite.target.mean - own.mean
    if (ahead if entry.better == "higher" else -ahead) > 0.0:
        return opposite
    return Offer(
        None,
        Message(
            "The {side} side is the better one on {performed_on}. Train the other side, or choose "
            "another source.",
            side=side,
            performed_on=day(walk.session.performed_on),
        ),
    )


def _norm(walk: AnalysedWalk, parameter: str) -> Offer:
    norms = walk.norms
    values = [norms.expected.get(parameter), norms.values.get(parameter)]
    norm = next((v for v in values if _serves(v)), None)
    if norm is None and (own := walk.own_controls()) is not None and _serves(own.values.get(parameter)):
        norm = own.values[parameter]
    if norm is not None:
        return Offer(Target("norm", norm.mean, norm.sd, _words(norm), walk.session.id))
    reason = norms.reason if is_angle(parameter) else norms.timing_reason
    if reason is not None:
        text = NO_NORM.get(reason, reason)
    else:
        norm_value = next((v for v in values if v is not None), None)
        text = "There is no norm of this parameter." if norm_value is None else norm_value.note
    return Offer(None, Message("{text} Choose another source, or enter a target.", text=text))


def _serves(value: NormValue | None) -> bool:
    return value is not None and value.comparable and value.sd > 0.0


def _own(walk: AnalysedWalk, parameter: str, side: Side | None) -> Offer:
    usual = find_usual_value(walk, parameter, side)
    label = "both sides" if side is None else Message("{side} side", side=side)
    if usual is None or usual.mean is None or not usual.sd or usual.n < FEWEST:
        n = 0 if usual is None else usual.n
        return Offer(
            None,
            Message(
                f"The {{label}} has {{value}} {plural(n, 'stride', 'strides')} with this parameter on "
                "{performed_on}; expected at least {FEWEST} that differ. Choose another source, or "
                "enter a target.",
                label=label,
                value=n,
                performed_on=day(walk.session.performed_on),
                FEWEST=FEWEST,
            ),
        )
    words = Message(
        f"{{label}}, {{usual}} {plural(usual.n, 'stride', 'strides')} on {{performed_on}}",
        label=label,
        usual=usual.n,
        performed_on=day(walk.session.performed_on),
    )
    source: TargetSource = "own_baseline"
    return Offer(Target(source, usual.mean, usual.sd, words, walk.session.id))


def _words(value: NormValue) -> str:
    group = GROUPS.get(value.group, value.group)
    people = "" if value.n is None else f", n = {value.n}"
    return f"{group}{people} ({value.source})"


def _mean(numbers: Numbers, name: str, side: Side | None) -> Parameter | None:
    return next(
        (p for p in numbers.parameters if (p.name, p.side) == (name, side) and p.mean is not None), None
    )


def _together(sides: list[Parameter]) -> Parameter:
    """Mean and sd over the strides of all sides."""
    n = sum(p.n for p in sides)
    mean = sum(p.n * (p.mean or 0.0) for p in sides) / n
    squares = sum((p.n - 1) * (p.sd or 0.0) ** 2 + p.n * ((p.mean or 0.0) - mean) ** 2 for p in sides)
    first = sides[0]
    return Parameter(first.name, None, n, mean, sqrt(squares / (n - 1)) if n > 1 else None, first.unit)


def _earlier(a: AnalysedSession, b: Session) -> bool:
    """Whether a visit precedes this session under the same condition, except for treadmill speed."""
    own = a.session
    if own.id == b.id or (own.performed_on, own.created_at) >= (b.performed_on, b.created_at):
        return False
    return is_alike(own.walked(), b.walked())
