"""Wording of a biofeedback prescription: parameter, target, modes, schedule and end."""

from __future__ import annotations

from typing import Final

from sagittal.core.feedback import Prescription
from sagittal.core.frames import Side
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
        ("Shown as", _shown(content)),
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
        text = f"{shares} of the strides"
        if len(s.shares_pct) > 1:
            text = f"{shares} of the strides, {s.strides_per_share} strides each"
    if s.probe_every is not None:
        text += f"; after every {s.probe_every}, {s.probe_strides} without"
    if s.retention_strides:
        text += f"; a visit after a training starts with {s.retention_strides} without"
    return text


def _zone(content: Prescription) -> str:
    return f"target ± {content.band_sd:g} SD; each level is {content.progression.sd_per_level:g} SD wider"


def _shown(content: Prescription) -> str:
    text = ", ".join(MODE_WORDS[m] for m in content.modes)
    if content.positive_only:
        return f"{text}; only strides in the zone"
    return f"{text}; only strides outside the zone" if content.bandwidth else text


def _level(content: Prescription) -> str:
    p = content.progression
    start = "as difficult as the last walk allows" if p.start_level is None else f"at level {p.start_level}"
    if not p.automatic:
        return f"starts {start}; changed manually"
    return (
        f"starts {start}; harder when more than {100 * p.share:g}{NBSP}% of {p.window} strides are in the "
        f"zone, easier when more than {100 * p.away_share:g}{NBSP}% are far off target"
    )


def _ends(content: Prescription) -> str:
    r = content.stop_rule
    conditions = []
    if r.max_minutes is not None:
        conditions.append(f"after {r.max_minutes:g} min")
    if r.max_strides is not None:
        conditions.append(f"after {r.max_strides} {plural(r.max_strides, 'stride', 'strides')}")
    if r.gps_rise_deg is not None:
        conditions.append(f"when the sagittal profile score rises by {r.gps_rise_deg:g}°")
    return ", ".join(conditions) or "when the therapist stops it"


def _watched(content: Prescription) -> str:
    g, term = content.guard, parameter_term(content.parameter)
    parts = []
    if content.side is not None:
        limit = "its MDC" if g.other_change is None else format_quantity(g.other_change, term)
        parts.append(f"a change of the other side by {limit}")
    if g.gps_rise_deg is not None:
        parts.append(f"a rise of the sagittal profile score by {g.gps_rise_deg:g}°")
    return ", ".join(parts) or "nothing"
