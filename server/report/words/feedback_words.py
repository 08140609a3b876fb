"""Wording of a biofeedback prescription: parameter, target, modes, schedule and end."""

from __future__ import annotations

from typing import Final

from sagittal.core.feedback import Prescription
from sagittal.core.frames import Side
from sagittal.core.message import Message
from sagittal.core.parameters.catalogue import CATALOGUE
from sagittal.core.plurals import plural
from sagittal.server.report.words.wording import Term, format_number, parameter_term

SOURCE_WORDS: Final = {
    "norm": "healthy people at this person's speed",
    "own_better_side": "the person's better side",
    "own_baseline": "the person's own baseline",
    "manual": "entered",
}
MODE_WORDS: Final = {
    "bar": "a bar",
    "zone": "a coloured zone",
    "tone": "a tone outside the zone",
    "tick": "a tick at every contact",
}
NBSP: Final = "\u202f"


def name_target(content: Prescription) -> str:
    """ "Step length, left"."""
    return f"{CATALOGUE[content.parameter].label}, {side_words(content.side)}"


def side_words(side: Side | None) -> str:
    """Trained side in words."""
    return "both sides" if side is None else side


def format_quantity(value: float, term: Term, digits: int | None = None) -> str:
    """A value with its unit."""
    unit = term.unit if term.unit in {"", "°"} else f"{NBSP}{term.unit}"
    return f"{format_number(value, term.digits if digits is None else digits)}{unit}"


def digits_of(content: Prescription) -> int:
    """Decimals of values next to the target: one more than in tables if the sd would hardly be visible."""
    digits, sd = CATALOGUE[content.parameter].digits, content.target.sd
    return digits + 1 if sd is not None and sd < 5.0 * 10.0**-digits else digits


def target_words(content: Prescription) -> str:
    """ "0.62 ± 0.05 m, adults …"."""
    t, term = content.target, parameter_term(content.parameter)
    if t.mean is None or t.sd is None:
        return SOURCE_WORDS[t.source]
    digits = digits_of(content)
    origin = "entered" if t.source == "manual" else t.words or SOURCE_WORDS[t.source]
    return f"{format_number(t.mean, digits)} ± {format_quantity(t.sd, term, digits)}, {origin}"


def prescription_words(content: Prescription) -> list[tuple[str, str]]:
    """The prescription as label and text, in display order."""
    return [
        ("Trained", name_target(content)),
        ("Target", target_words(content)),
        ("Zone", _zone(content)),
        ("Display name", _shown(content)),
        ("Schedule", schedule_words(content)),
        ("Level", _level(content)),
        ("Ends", _ends(content)),
        ("Watched", _watched(content)),
    ]


def schedule_words(content: Prescription) -> str:
    """Schedule of strides with feedback, in words."""
    s = content.schedule
    if s.kind == "every":
        text = "every stride"
    else:
        shares = " → ".join(f"{p}{NBSP}%" for p in s.shares_pct)
        text = Message("{shares} of the strides", shares=shares)
        if len(s.shares_pct) > 1:
            text = Message(
                "{shares} of the strides, {strides_per_share} strides each",
                shares=shares,
                strides_per_share=s.strides_per_share,
            )
    if s.probe_every is not None:
        text += Message(
            "; after every {probe_every}, {probe_strides} without",
            probe_every=s.probe_every,
            probe_strides=s.probe_strides,
        )
    if s.retention_strides:
        text += Message(
            "; a visit after a training starts with {retention_strides} without",
            retention_strides=s.retention_strides,
        )
    return text


def _zone(content: Prescription) -> str:
    return Message(
        "target ± {band_sd:g} SD; each level is {sd_per_level:g} SD wider",
        band_sd=content.band_sd,
        sd_per_level=content.progression.sd_per_level,
    )


def _shown(content: Prescription) -> str:
    text = ", ".join(MODE_WORDS[m] for m in content.modes)
    if content.positive_only:
        return Message("{text}; only strides in the zone", text=text)
    return Message("{text}; only strides outside the zone", text=text) if content.bandwidth else text


def _level(content: Prescription) -> str:
    p = content.progression
    start = (
        "as difficult as the last walk allows"
        if p.start_level is None
        else Message("at level {start_level}", start_level=p.start_level)
    )
    if not p.automatic:
        return Message("starts {start}; changed manually", start=start)
    return Message(
        "starts {start}; harder when more than {share:g}{NBSP}% of {window} strides are in the zone, "
        "easier when more than {away_share:g}{NBSP2}% are far off target",
        start=start,
        share=100 * p.share,
        NBSP=NBSP,
        window=p.window,
        away_share=100 * p.away_share,
        NBSP2=NBSP,
    )


def _ends(content: Prescription) -> str:
    r = content.stop_rule
    conditions = []
    if r.max_minutes is not None:
        conditions.append(Message("after {max_minutes:g} min", max_minutes=r.max_minutes))
    if r.max_strides is not None:
        conditions.append(
            Message(
                f"after {{max_strides}} {plural(r.max_strides, 'stride', 'strides')}",
                max_strides=r.max_strides,
            )
        )
    if r.gps_rise_deg is not None:
        conditions.append(
            Message("when the sagittal profile score rises by {gps_rise_deg:g}°", gps_rise_deg=r.gps_rise_deg)
        )
    return ", ".join(conditions) or "when the therapist stops it"


def _watched(content: Prescription) -> str:
    g, term = content.guard, parameter_term(content.parameter)
    parts = []
    if content.side is not None:
        limit = "its MDC" if g.other_change is None else format_quantity(g.other_change, term)
        parts.append(Message("a change of the other side by {limit}", limit=limit))
    if g.gps_rise_deg is not None:
        parts.append(
            Message("a rise of the sagittal profile score by {gps_rise_deg:g}°", gps_rise_deg=g.gps_rise_deg)
        )
    return ", ".join(parts) or "nothing"
