"""Sentences of the findings, as in a clinical letter: parameter, amount, side, both values, norm.

A pattern has one part between asterisks, which is printed in bold. `{noun}` is the parameter, `{word}` its
relation to the norm or the other side, `{d}` a difference, `{v}` the value of the side named and `{o}` that
of the other, `{l}` and `{r}` left and right, `{norm}` mean ± SD; all with their units.
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
"""Parameters that describe the same aspect of gait: only the most conspicuous one becomes a sentence."""


@dataclass(frozen=True)
class Phrases:
    """Wording of the findings about one parameter.

    Parameters
    ----------
    family : group of parameters of which one becomes a sentence.
    least : smallest difference between the sides that is reported, in the unit of the parameter; our choice.
    noun : the parameter at the beginning of a sentence.
    low, high : both sides, one side or the whole trial below or above the norm; empty if that is no finding.
    less, more : the side named compared with the other side; empty where sides are not compared.
    apart : largest difference between the sides of healthy people as a share of their mean; 0 if the norm
        gives it or none is known.
    names_larger : without a norm the side with the larger value is named, else that with the smaller one.
    sign : −1 for parameters whose noun is the opposite of their sign, such as extension for flexion.
    """

    family: Family
    least: float
    noun: str
    low: str = "reduced"
    high: str = "increased"
    less: str = "less"
    more: str = "more"
    apart: float = 0.0
    names_larger: bool = False
    sign: Literal[-1, 1] = 1


PHRASES: Final[Mapping[str, Phrases]] = {
    "gait_speed_mps": Phrases(
        "speed", 0.0, "Gait speed", low="below normal for age", high="above normal for age", less="", more=""
    ),
    "cadence_spm": Phrases("step", 0.0, "Cadence", low="below normal", high="above normal", less="", more=""),
    "step_length_m": Phrases("step", 0.02, "Step length", apart=0.08, less="shorter", more="longer"),
    "step_time_s": Phrases(
        "step", 0.02, "Step time", "", "", less="shorter", more="longer", apart=0.08, names_larger=True
    ),
    "stance_pct": Phrases(
        "support",
        2.0,
        "Stance phase",
        "shortened",
        "prolonged",
        "shorter",
        "longer",
        apart=0.05,
        names_larger=True,
    ),
    "double_support_pct": Phrases(
        "support", 2.0, "Double support", "shortened", "prolonged", less="", more=""
    ),
    "foot_pitch_ic_deg": Phrases("foot_contact", 5.0, "Foot angle at contact", less="lower", more="higher"),
    "ankle_dorsiflexion_ic_deg": Phrases("foot_contact", 5.0, "Ankle dorsiflexion at contact", "", ""),
    "ankle_dorsiflexion_max_swing_deg": Phrases("foot_swing", 5.0, "Ankle dorsiflexion in swing", high=""),
    "circumduction_m": Phrases("foot_swing", 0.02, "Circumduction", "", "", names_larger=True),
    "foot_pitch_tc_deg": Phrases(
        "push_off", 5.0, "Foot angle at push-off", "", "", names_larger=True, sign=-1
    ),
    "ankle_dorsiflexion_rom_deg": Phrases("push_off", 5.0, "Ankle range of motion"),
    "knee_flexion_min_stance_deg": Phrases(
        "knee_stance", 5.0, "Minimum knee flexion in stance", names_larger=True
    ),
    "knee_flexion_ic_deg": Phrases("knee_stance", 5.0, "Knee flexion at contact", low="", names_larger=True),
    "knee_flexion_max_swing_deg": Phrases("knee_swing", 5.0, "Knee flexion in swing"),
    "knee_flexion_rom_deg": Phrases("knee_swing", 5.0, "Knee range of motion"),
    "hip_flexion_min_deg": Phrases("hip", 5.0, "Peak hip extension", high="", names_larger=True, sign=-1),
    "hip_flexion_rom_deg": Phrases("hip", 5.0, "Hip range of motion"),
}
"""In the order in which findings of equal size are reported."""

require_entries(PHRASES, "sagittal.server.report.words.headline_phrases")

OF_SIDES: Final = "{noun} is *{d} {word} on the {side}* ({v} vs {o}{norm})"
"""One side compared with the other."""

OF_SIDE: Final = "{noun} is *{word} on the {side}* ({v}{norm})"
"""One side compared with the norm."""

OF_BOTH: Final = "{noun} is *{word} on both sides* (left {l}, right {r}{norm})"
"""Both sides compared with the norm."""

OF_TRIAL: Final = "{noun} is *{word}* ({v}{norm})"
"""A parameter of the whole trial compared with the norm."""

NORM: Final = ", norm {mean} ± {sd}"
"""Addition to a sentence."""

CHANGED_UP: Final = "{noun} has *increased by {d} on the {side}* ({before} to {after})"
CHANGED_DOWN: Final = "{noun} has *decreased by {d} on the {side}* ({before} to {after})"
TRIAL_CHANGED_UP: Final = "{noun} has *increased by {d}* ({before} to {after})"
TRIAL_CHANGED_DOWN: Final = "{noun} has *decreased by {d}* ({before} to {after})"
"""Real changes since the previous visit."""

BOTH_LONGER: Final = "Step length has *increased on both sides* (left by {l} m, right by {r} m)"
BOTH_SHORTER: Final = "Step length has *decreased on both sides* (left by {l} m, right by {r} m)"
"""Both step lengths have changed in the same direction."""

SHORT_AND_QUICK: Final = "Steps are *short and quick* ({l} at {c}{norm})"
"""Both step lengths are below the norm and cadence is above it."""

PELVIS_RISES: Final = "Pelvic elevation in swing is *{v}° on the {side}* (limit {b}°)"
"""The rule "hip_hiking" is beyond its limit."""

PATTERNS: Final = (
    OF_SIDES, OF_SIDE, OF_BOTH, OF_TRIAL, CHANGED_UP, CHANGED_DOWN, TRIAL_CHANGED_UP, TRIAL_CHANGED_DOWN,
    BOTH_LONGER, BOTH_SHORTER, SHORT_AND_QUICK, PELVIS_RISES,
)  # fmt: skip
"""All sentences of the findings."""
