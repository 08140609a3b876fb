"""What each parameter is, in one sentence; docs/parameters.md says more."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

_PEAK = "{what} of {joint} {when}, from the person's own standing."


def _angle(what: str, joint: str, when: str) -> str:
    return _PEAK.format(what=what, joint=joint, when=when)


_SHARE = "{what}, as a share of the stride."

DEFINITIONS: Final[Mapping[str, str]] = {
    "gait_speed_mps": "Stride length over the time between the same two foot-flats, mean of both feet.",
    "stride_length_m": "Distance on the floor between two successive foot-flats of one foot.",
    "step_length_m": (
        "Distance along the direction of progression from the other foot's flat to this foot's; it belongs "
        "to the foot that lands."
    ),
    "step_width_m": (
        "Distance across the direction of progression between the flats of the two feet, ankle to ankle; "
        "negative when the feet cross."
    ),
    "circumduction_m": "Largest distance of the foot outward from the straight line between its two flats.",
    "max_heel_clearance_m": "Highest point of the heel above the floor in swing.",
    "min_toe_clearance_m": "Lowest point of the tip of the shoe above the floor in the middle of swing.",
    "total_distance_m": "Way of the take from rest to rest of a foot, turns and all; mean of the feet.",
    "cadence_spm": "60 over the mean step time of both feet.",
    "pci_pct": (
        "Phase coordination index (Plotnik 2007): how far and how variably the step times depart from half "
        "of the stride; 0 is perfectly alternating."
    ),
    "stride_time_s": "From a contact of the foot to its next.",
    "step_time_s": "From the other foot's contact to this foot's; it belongs to the foot that lands.",
    "stance_time_s": "From contact to foot-off of the same foot.",
    "swing_time_s": "From foot-off to the next contact of the same foot.",
    "stance_pct": _SHARE.format(what="From contact to foot-off"),
    "swing_pct": _SHARE.format(what="From foot-off to the next contact"),
    "double_support_pct": _SHARE.format(what="Both feet on the floor"),
    "initial_double_support_pct": _SHARE.format(what="From contact to the other foot's foot-off"),
    "terminal_double_support_pct": _SHARE.format(what="From the other foot's contact to foot-off"),
    "single_support_pct": _SHARE.format(what="From the other foot's foot-off to its contact"),
    "double_support_s": "Time with both feet on the floor in a stride.",
    "initial_double_support_s": "From contact to the other foot's foot-off.",
    "terminal_double_support_s": "From the other foot's contact to foot-off.",
    "single_support_s": "From the other foot's foot-off to its contact.",
    "loading_pct": "From contact until the foot is flat, as a share of stance.",
    "foot_flat_pct": "The foot flat on the floor, as a share of stance.",
    "push_pct": "From the heel's leaving the floor to foot-off, as a share of stance.",
    "mid_stance_pct": _SHARE.format(what="From the other foot's foot-off until the heel rises"),
    "terminal_stance_pct": _SHARE.format(what="From the rise of the heel to the other foot's contact"),
    "initial_swing_pct": _SHARE.format(what="From foot-off until the feet pass each other"),
    "mid_swing_pct": _SHARE.format(what="From there until the shank is vertical"),
    "terminal_swing_pct": _SHARE.format(what="From there to contact"),
    "hip_flexion_ic_deg": _angle("Flexion", "the hip", "at contact"),
    "hip_flexion_min_deg": _angle("Least flexion", "the hip", "in the stride"),
    "hip_flexion_rom_deg": "Largest minus least hip flexion in the stride.",
    "knee_flexion_ic_deg": _angle("Flexion", "the knee", "at contact"),
    "knee_flexion_max_loading_deg": _angle("Largest flexion", "the knee", "while the leg is loaded"),
    "knee_flexion_min_stance_deg": _angle("Least flexion", "the knee", "in stance"),
    "knee_flexion_max_swing_deg": _angle("Largest flexion", "the knee", "in swing"),
    "knee_flexion_rom_deg": "Largest minus least knee flexion in the stride.",
    "ankle_dorsiflexion_ic_deg": _angle("Dorsiflexion", "the ankle", "at contact"),
    "ankle_dorsiflexion_max_stance_deg": _angle("Largest dorsiflexion", "the ankle", "in stance"),
    "ankle_dorsiflexion_min_deg": _angle("Least dorsiflexion", "the ankle", "in the stride"),
    "ankle_dorsiflexion_max_swing_deg": _angle("Largest dorsiflexion", "the ankle", "in swing"),
    "ankle_dorsiflexion_rom_deg": "Largest minus least dorsiflexion in the stride.",
    "foot_pitch_ic_deg": "Angle of the sole to the floor at contact, toes up positive.",
    "foot_pitch_tc_deg": "Angle of the sole to the floor at foot-off, toes up positive.",
    "toe_out_deg": "Foot against the direction of progression while flat, outward positive, from standing.",
    "turning_angle_deg": "Change of the foot's heading over the stride, left positive.",
    "step_count": "Steps found by the sensor on the trunk.",
    "walking_bout_count": "Parts of the take with at least four strides and no break longer than 3 s.",
    "walking_duration_min": "Time in these parts.",
    "turn_count": "Turns of the body by 45° or more.",
    "turn_angle_deg": "Angle by which the body turned, mean of the turns.",
    "turn_duration_s": "Time that a turn takes.",
    "turn_peak_velocity_dps": "Fastest rate of turning in a turn.",
    "stride_sparc": "Spectral arc length of the trunk's acceleration in a stride: nearer to 0 is smoother.",
    "harmonic_ratio_v": "Even over odd harmonics of the vertical acceleration of the trunk in a stride.",
    "harmonic_ratio_ap": "Even over odd harmonics of the forward acceleration of the trunk in a stride.",
    "harmonic_ratio_ml": "Odd over even harmonics of the sideways acceleration of the trunk in a stride.",
    "step_regularity_v": "Autocorrelation of the trunk's vertical acceleration at one step.",
    "step_regularity_ap": "Autocorrelation of the trunk's forward acceleration at one step.",
    "stride_regularity_v": "Autocorrelation of the trunk's vertical acceleration at one stride.",
    "stride_regularity_ap": "Autocorrelation of the trunk's forward acceleration at one stride.",
}
"""Parameter → its definition."""
