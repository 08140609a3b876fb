"""Sentences of the headline: parameters, families and phrases.

A pattern has one bold part, between asterisks: the number and its meaning. `{side}` and `{other}` are the leg
concerned and the opposite one, `{d}` the difference, `{v}` the value of one side, `{l}` and `{r}` those of
both, `{a}` and `{b}` the norm's mean − 1 SD and + 1 SD.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from sagittal.core.parameters.catalogue import require_entries

Family = Literal[
    "speed", "step", "support", "foot_contact", "foot_swing", "push_off", "knee_stance", "knee_swing", "hip",
    "trunk",
]  # fmt: skip
"""Figures that tell the same thing: the one that stands out most speaks for all."""


@dataclass(frozen=True)
class Phrases:
    """Phrases for one parameter.

    Parameters
    ----------
    family : group from which one parameter is reported.
    least : smallest reported difference of the sides, in the parameter's unit; our choice.
    apart : upper limit of the difference in healthy subjects, as a fraction of the mean; 0 if the norm covers
        it or it is unknown.
    smaller, larger : for different sides, naming that with the smaller or larger value. The side further from
        the norm is named.
    names_larger : without a norm, name the side with the larger value, otherwise the smaller.
    both_low, both_high : both sides, or the whole trial, outside the norm.
    side_low, side_high : one side outside the norm.
    up, down : change since the previous visit.
    """

    family: Family
    least: float
    smaller: str = ""
    larger: str = ""
    both_low: str = ""
    both_high: str = ""
    side_low: str = ""
    side_high: str = ""
    up: str = ""
    down: str = ""
    apart: float = 0.0
    names_larger: bool = False


PHRASES: Final[Mapping[str, Phrases]] = {
    "gait_speed_mps": Phrases(
        "speed",
        0.0,
        both_low="Walks *slower than usual* for the age: {v} m/s, usual {a} to {b}",
        both_high="Walks *faster than usual* for the age: {v} m/s, usual {a} to {b}",
        up="Walks *faster*: by {d} m/s",
        down="Walks *slower*: by {d} m/s",
    ),
    "cadence_spm": Phrases(
        "step",
        0.0,
        both_low="Steps are *slow*: {v} a minute, usual at this speed {a} to {b}",
        both_high="Steps are *quick*: {v} a minute, usual at this speed {a} to {b}",
        up="Takes *{d} more steps* a minute",
        down="Takes *{d} fewer steps* a minute",
    ),
    "step_length_m": Phrases(
        "step",
        0.02,
        apart=0.08,
        smaller="The {side} step is *{d} m shorter* than the {other}",
        larger="The {side} step is *{d} m longer* than the {other}",
        both_low="Both steps are *short*: {l} m and {r} m, usual at this speed {a} to {b}",
        both_high="Both steps are *long*: {l} m and {r} m, usual at this speed {a} to {b}",
        side_low="The {side} step is *short*: {v} m, usual at this speed {a} to {b}",
        side_high="The {side} step is *long*: {v} m, usual at this speed {a} to {b}",
        up="The {side} step is *{d} m longer*",
        down="The {side} step is *{d} m shorter*",
    ),
    "step_time_s": Phrases(
        "step",
        0.02,
        apart=0.08,
        smaller="The {side} step takes *{d} s less* than the {other}",
        larger="The {side} step takes *{d} s longer* than the {other}",
        names_larger=True,
        up="The {side} step takes *{d} s longer*",
        down="The {side} step takes *{d} s less*",
    ),
    "stance_pct": Phrases(
        "support",
        2.0,
        apart=0.05,
        smaller="The {side} stance phase is *{d} points shorter* than the {other}",
        larger="The {side} leg carries longer: *{d} points* more stance than the {other}",
        names_larger=True,
        both_low="Both feet carry *shortly*: {l} % and {r} % of the stride, usual {a} to {b}",
        both_high="Both feet carry *long*: {l} % and {r} % of the stride, usual {a} to {b}",
        side_low="The {side} leg carries *shortly*: {v} % of the stride, usual {a} to {b}",
        side_high="The {side} leg carries *long*: {v} % of the stride, usual {a} to {b}",
        up="The {side} leg carries *{d} points longer*",
        down="The {side} leg carries *{d} points shorter*",
    ),
    "double_support_pct": Phrases(
        "support",
        2.0,
        both_low="Both feet are *seldom* on the floor together: {l} % and {r} %, usual {a} to {b}",
        both_high="Both feet are *often* on the floor together: {l} % and {r} %, usual {a} to {b}",
        up="Both feet are on the floor for *{d} points more* of the stride",
        down="Both feet are on the floor for *{d} points less* of the stride",
    ),
    "foot_pitch_ic_deg": Phrases(
        "foot_contact",
        5.0,
        smaller="The {side} foot lands *{d}° flatter* than the {other}",
        larger="The {side} foot lands with the toes *{d}° higher* than the {other}",
        both_low="Both feet land *flat*: toes {l}° and {r}° up, usual {a}° to {b}°",
        both_high="Both feet land *steeply*: toes {l}° and {r}° up, usual {a}° to {b}°",
        side_low="The {side} foot lands *flat*: toes {v}° up, usual {a}° to {b}°",
        side_high="The {side} foot lands *steeply*: toes {v}° up, usual {a}° to {b}°",
        up="The {side} foot lands with the toes *{d}° higher*",
        down="The {side} foot lands with the toes *{d}° lower*",
    ),
    "ankle_dorsiflexion_ic_deg": Phrases(
        "foot_contact",
        5.0,
        smaller="The {side} ankle is *{d}° more pointed* at contact than the {other}",
        larger="The {side} ankle is *{d}° more dorsiflexed* at contact than the {other}",
        up="The {side} ankle is *{d}° less pointed* at contact",
        down="The {side} ankle is *{d}° more pointed* at contact",
    ),
    "ankle_dorsiflexion_max_swing_deg": Phrases(
        "foot_swing",
        5.0,
        smaller="The {side} toes *hang {d}° lower* in swing than the {other}",
        larger="The {side} ankle is *{d}° more dorsiflexed* in swing than the {other}",
        both_low="Both feet *hang down* in swing: {l}° and {r}° up, usual {a}° to {b}°",
        side_low="The {side} foot *hangs down* in swing: {v}° up, usual {a}° to {b}°",
        up="The {side} toes are held *{d}° higher* in swing",
        down="The {side} toes hang *{d}° lower* in swing",
    ),
    "circumduction_m": Phrases(
        "foot_swing",
        0.02,
        smaller="The {side} foot swings *{cm} cm less* to the side than the {other}",
        larger="The {side} foot swings *{cm} cm further* to the side than the {other}",
        names_larger=True,
        up="The {side} foot swings *{cm} cm further* to the side",
        down="The {side} foot swings *{cm} cm less* to the side",
    ),
    "foot_pitch_tc_deg": Phrases(
        "push_off",
        5.0,
        smaller="The {side} heel rises *{d}° more* at push-off than the {other}",
        larger="The {side} heel rises *{d}° less* at push-off than the {other}",
        names_larger=True,
        up="The {side} heel rises *{d}° less* at push-off",
        down="The {side} heel rises *{d}° more* at push-off",
    ),
    "ankle_dorsiflexion_rom_deg": Phrases(
        "push_off",
        5.0,
        smaller="The {side} ankle moves *{d}° less* than the {other}",
        larger="The {side} ankle moves *{d}° more* than the {other}",
        both_low="Both ankles move *little*: {l}° and {r}°, usual {a}° to {b}°",
        both_high="Both ankles move *much*: {l}° and {r}°, usual {a}° to {b}°",
        side_low="The {side} ankle moves *little*: {v}°, usual {a}° to {b}°",
        side_high="The {side} ankle moves *much*: {v}°, usual {a}° to {b}°",
        up="The {side} ankle moves *{d}° more*",
        down="The {side} ankle moves *{d}° less*",
    ),
    "knee_flexion_min_stance_deg": Phrases(
        "knee_stance",
        5.0,
        smaller="The {side} knee is *{d}° straighter* in stance than the {other}",
        larger="The {side} knee stays *{d}° more bent* in stance than the {other}",
        names_larger=True,
        both_low="Both knees go *past straight* in stance: {l}° and {r}°, usual {a}° to {b}°",
        both_high="Both knees stay *bent* while they carry: {l}° and {r}°, usual {a}° to {b}°",
        side_low="The {side} knee goes *past straight* in stance: {v}°, usual {a}° to {b}°",
        side_high="The {side} knee stays *bent* while it carries: {v}°, usual {a}° to {b}°",
        up="The {side} knee is *{d}° more bent* in stance",
        down="The {side} knee is *{d}° straighter* in stance",
    ),
    "knee_flexion_ic_deg": Phrases(
        "knee_stance",
        5.0,
        smaller="The {side} knee lands *{d}° straighter* than the {other}",
        larger="The {side} knee lands *{d}° more bent* than the {other}",
        names_larger=True,
        both_high="Both knees land *bent*: {l}° and {r}°, usual {a}° to {b}°",
        side_high="The {side} knee lands *bent*: {v}°, usual {a}° to {b}°",
        up="The {side} knee lands *{d}° more bent*",
        down="The {side} knee lands *{d}° straighter*",
    ),
    "knee_flexion_max_swing_deg": Phrases(
        "knee_swing",
        5.0,
        smaller="The {side} knee bends *{d}° less* in swing than the {other}",
        larger="The {side} knee bends *{d}° more* in swing than the {other}",
        both_low="Both knees bend *little* in swing: {l}° and {r}°, usual {a}° to {b}°",
        both_high="Both knees bend *much* in swing: {l}° and {r}°, usual {a}° to {b}°",
        side_low="The {side} knee bends *little* in swing: {v}°, usual {a}° to {b}°",
        side_high="The {side} knee bends *much* in swing: {v}°, usual {a}° to {b}°",
        up="The {side} knee bends *{d}° more* in swing",
        down="The {side} knee bends *{d}° less* in swing",
    ),
    "knee_flexion_rom_deg": Phrases(
        "knee_swing",
        5.0,
        smaller="The {side} knee moves *{d}° less* than the {other}",
        larger="The {side} knee moves *{d}° more* than the {other}",
        both_low="Both knees move *little*: {l}° and {r}°, usual {a}° to {b}°",
        both_high="Both knees move *much*: {l}° and {r}°, usual {a}° to {b}°",
        side_low="The {side} knee moves *little*: {v}°, usual {a}° to {b}°",
        side_high="The {side} knee moves *much*: {v}°, usual {a}° to {b}°",
        up="The {side} knee moves *{d}° more*",
        down="The {side} knee moves *{d}° less*",
    ),
    "hip_flexion_min_deg": Phrases(
        "hip",
        5.0,
        smaller="The {side} hip extends *{d}° further* than the {other}",
        larger="The {side} hip stays *{d}° short* of the {other} behind the body",
        names_larger=True,
        both_high="Both hips stay *short* behind the body: {l}° and {r}°, usual {a}° to {b}°",
        side_high="The {side} hip stays *short* behind the body: {v}°, usual {a}° to {b}°",
        up="The {side} hip goes *{d}° less far* behind the body",
        down="The {side} hip goes *{d}° further* behind the body",
    ),
    "hip_flexion_rom_deg": Phrases(
        "hip",
        5.0,
        smaller="The {side} hip moves *{d}° less* than the {other}",
        larger="The {side} hip moves *{d}° more* than the {other}",
        both_low="Both hips move *little*: {l}° and {r}°, usual {a}° to {b}°",
        both_high="Both hips move *much*: {l}° and {r}°, usual {a}° to {b}°",
        side_low="The {side} hip moves *little*: {v}°, usual {a}° to {b}°",
        side_high="The {side} hip moves *much*: {v}°, usual {a}° to {b}°",
        up="The {side} hip moves *{d}° more*",
        down="The {side} hip moves *{d}° less*",
    ),
}
"""In the order in which equals are told."""

require_entries(PHRASES, "sagittal.server.report.words.headline_phrases")

SHORT_AND_QUICK: Final = (
    "Steps are *short and quick*: {l} m at {c} a minute, usual at this speed {a} to {b} m"
)
"""Both steps and the cadence are beyond the norm, the one low and the other high."""

BOTH_STEPS: Final = "*Both steps are {word}*: left by {l} m, right by {r} m"
"""Both step lengths changed the same way."""

PELVIS_RISES: Final = "The pelvis rises *{v}°* on the {side} in swing, usual below {b}°"
"""The rule "hip_hiking" is beyond its limit."""
