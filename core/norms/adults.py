"""The 42 healthy adults of the WBDS as a reference for scores."""

from __future__ import annotations

from functools import cache
from typing import Final

from sagittal.core.norms.at_speed import is_matched, reference_at_speed
from sagittal.core.norms.kinematics import adult_kinematics
from sagittal.core.norms.profile import MODES, CurveReference, Mode, ScoreSpread
from sagittal.core.norms.speed import WalkingSpeed
from sagittal.core.norms.tables import WBDS, WBDS_N, read_rows, wbds_group

_KEYS: Final = {
    "GPS_side_9var": "gps_side",
    "GPS_overall_15": "gps_overall",
    "GPS_sagittal_side_3": "gps_sagittal_side",
    "GPS_sagittal_overall_6": "gps_sagittal_overall",
}


@cache
def adult_reference() -> CurveReference:
    """Reference of GVS, GPS, gps_sagittal and GDI*: comfortable overground walking, anatomical angles.

    One group for every age: the spread of the scores is that among all 42 people, and speed changes the
    curves more than age does (docs/science/norms-and-scores.md, "Speed").
    """
    bands = adult_kinematics(None).bands
    return CurveReference(
        mean_deg={name: band.mean_deg for name, band in bands.items()},
        spreads={mode: _spreads(mode) for mode in MODES},
        zero="anatomical",
        n=WBDS_N["adult_21_84"],
        group="adult_21_84",
        source=WBDS,
    )


def adult_reference_at_speed(age: float | None, speed: WalkingSpeed | None) -> CurveReference | None:
    """Reference of healthy adults walking at this instructed speed; None outside their range of speeds, or
    below 18 years.
    """
    if speed is None or not is_matched(speed.norm_speed) or wbds_group(age) is None:
        return None
    return reference_at_speed(age, speed.norm_speed, adult_reference())


def _spreads(mode: Mode) -> dict[str, ScoreSpread]:
    return {
        r["variable"] or _KEYS[r["score"]]: ScoreSpread(
            mean_deg=float(r["mean"]),
            sd_deg=float(r["sd"]),
            median_deg=float(r["median"]),
            p75_deg=float(r["p75"]),
            p95_deg=float(r["p95"]),
            mean_ln=float(r["mean_ln"]) if r["mean_ln"] else None,
            sd_ln=float(r["sd_ln"]) if r["sd_ln"] else None,
        )
        for r in (*read_rows("gps_reference_wbds"), *read_rows("gps_sagittal_wbds"))
        if r["mode"] == mode
    }
