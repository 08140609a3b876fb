"""Norm at the person's speed: people left out, and data of other laboratories.

Each of the 52 adults (means at five speeds) is compared with the model of the others. Children and adults of
two other sets are compared with their own comfortable curve moved to the slow speed, as the product does with
the WBDS adults. Level blending and form of the model were chosen in view of these sets; the coefficients were
not fitted to them.
"""

from __future__ import annotations

import csv
import gzip
from functools import cache

import numpy as np

from sagittal.core.frames import Floats
from sagittal.core.norms import adult_kinematics, adult_reference
from sagittal.core.norms.at_speed import bands_at_speed, curve_models, move_curve, reference_at_speed
from sagittal.core.norms.profile import gvs
from sagittal.core.norms.speed import COMFORTABLE
from tests.data import data_folder
from validation.figures import record

BINS = ((0.085, 0.12), (0.12, 0.18), (0.18, 0.25), (0.25, 0.32), (0.32, 0.439))
"""v*; the second is the gap between two conditions, 11 people."""

LIMIT_DEG = {"knee_flexion": (6.6, 6.5, 5.2, 4.3, 4.6), "ankle_dorsiflexion": (4.2, 5.8, 3.5, 4.1, 3.2)}
"""RMS of a person left out, by bin; measured when the tables were made (6.2 … and 3.9 …) and a little."""

CROSS_LIMIT_DEG = {"hip_flexion": 1.2, "knee_flexion": 2.8, "ankle_dorsiflexion": 2.6, "hip_adduction": 1.3}
"""RMS of a moved curve against the slow curve of the same laboratory; measured 1.0, 2.6, 2.4, 1.1 at most."""


@cache
def people(variable: str) -> tuple[Floats, Floats, Floats]:
    """Subject, v* and curve (n, 101) of every mean curve of a variable."""
    path = data_folder("norms") / "speed" / "curves_rehazenter52_knee_ankle_subject_speed.csv.gz"
    with gzip.open(path, "rt", encoding="utf-8") as file:
        rows = [r for r in csv.DictReader(file) if r["variable"] == variable]
    curves = np.array([[float(r[f"p{i}"]) for i in range(101)] for r in rows])
    return np.array([float(r["subject"]) for r in rows]), np.array([float(r["vstar"]) for r in rows]), curves


@cache
def left_out(variable: str) -> Floats:
    """Curve minus the model made of the other people (n, 101)."""
    subject, v, curves = people(variable)
    terms = np.stack((np.ones_like(v), np.log(v), np.log(v) ** 2), axis=1)
    off = np.empty_like(curves)
    for s in np.unique(subject):
        own = subject == s
        off[own] = curves[own] - terms[own] @ np.linalg.lstsq(terms[~own], curves[~own], rcond=None)[0]
    return off


def test_the_shipped_model_is_the_fit_of_these_people() -> None:
    for variable, model in curve_models().items():
        if model.n < 52:
            continue
        _, v, curves = people(variable)
        terms = np.stack((np.ones_like(v), np.log(v), np.log(v) ** 2), axis=1)
        fit = np.linalg.lstsq(terms, curves, rcond=None)[0].T
        assert np.abs(terms @ (fit - model.coefficients).T).max() < 0.01, "degrees; they keep v* to 0.001"


def test_people_left_out_are_nearer_to_the_norm_at_their_speed() -> None:
    rows = []
    for variable, limits in LIMIT_DEG.items():
        subject, v, curves = people(variable)
        model, off = curve_models()[variable], left_out(variable)
        fixed = curves - model.mean(COMFORTABLE)
        for (low, high), limit in zip(BINS, limits, strict=True):
            indices = np.flatnonzero((v >= low) & (v < high))
            # the band of one side, as it is drawn; mean of both sides here
            sd = np.array([bands_at_speed(None, float(x))[variable].sd_deg for x in v[indices]])
            usual = adult_kinematics(None).bands[variable].sd_deg
            rms, rms_fixed = (float(np.sqrt(np.mean(x[indices] ** 2))) for x in (off, fixed))
            bias = float(np.sqrt(np.mean(off[indices].mean(axis=0) ** 2)))
            inside = 100.0 * float(np.mean(np.abs(off[indices]) <= 2.0 * sd))
            inside_fixed = 100.0 * float(np.mean(np.abs(fixed[indices]) <= 2.0 * usual))
            rows.append(
                [
                    variable.replace("_", " "),
                    f"{low:g}–{high:g}",
                    f"{len(np.unique(subject[indices]))}",
                    f"{rms:.1f} / {rms_fixed:.1f}",
                    f"{bias:.1f}",
                    f"{inside:.0f} / {inside_fixed:.0f}",
                    f"{limit:g}",
                ]
            )
            assert rms < limit, (variable, low)
            assert rms <= rms_fixed, (variable, low)
            assert inside >= 88.0, (variable, low)
    record(
        "Norm at the person's speed: people left out",
        [
            "angle", "v*", "people", "RMS °, this norm / comfortable one", "of which common to all °",
            "points within ± 2 SD %, this / comfortable", "limit of the RMS °",
        ],
        rows,
        "52 adults at five speeds (Schreiber & Moissenet 2019), each against the model of the others, own "
        "zero included; SD as drawn, of the product's band.",
    )  # fmt: skip


def test_scores_of_people_left_out_spread_as_the_reference_says() -> None:
    """Shape scores at slow speed: the comfortable spread, grown by that of the bands, without a fit."""
    rows = []
    for variable in LIMIT_DEG:
        _, v, _ = people(variable)
        off = left_out(variable)
        for low, high in BINS:
            indices = np.flatnonzero((v >= low) & (v < high))
            scores = gvs(off[indices], np.zeros(101), "offset_removed")
            spread = [
                reference_at_speed(None, float(x), adult_reference()).spreads["offset_removed"][variable]
                for x in v[indices]
            ]
            beyond = 100.0 * float(
                np.mean([s > notices.p95_deg for s, notices in zip(scores, spread, strict=True)])
            )
            usual = adult_reference().spreads["offset_removed"][variable].p95_deg
            beyond_fixed = 100.0 * float(np.mean(scores > usual))
            median = float(np.median(scores)), float(np.mean([s.median_deg for s in spread]))
            rows.append(
                [
                    variable.replace("_", " "),
                    f"{low:g}–{high:g}",
                    f"{median[0]:.1f} / {median[1]:.1f}",
                    f"{beyond:.0f} / {beyond_fixed:.0f}",
                ]
            )
    record(
        "Norm at the person's speed: spread of scores",
        [
            "angle",
            "v*",
            "median GVS °, measured / told",
            "beyond the 95th percentile %, as told / comfortable",
        ],
        rows,
        "Shape (offsets removed). The told spread is that of comfortable walking, grown as the band grows.",
    )
    worst = max(float(row[3].split(" / ")[0]) for row in rows)
    assert worst <= 35.0


@cache
def other_sets() -> dict[str, dict[str, Floats]]:
    """Curves by set and condition, in the signs of the product."""
    result: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for name, keep in (("schwartz2008", None), ("bovi2011", "adult_22_72")):
        with (data_folder("norms") / f"kinematics_{name}.csv").open(encoding="utf-8") as file:
            for r in csv.DictReader(file):
                if keep is None or r["group"] == keep:
                    position = result.setdefault(f"{name} {r['condition']}", {}).setdefault(r["variable"], [])
                    sign = -1.0 if (name, r["variable"]) == ("bovi2011", "pelvis_tilt") else 1.0
                    position.append((float(r["pct_cycle"]), sign * float(r["mean_deg"])))
    return {
        condition: {
            variable: np.interp(np.arange(101), *np.array(sorted(points)).T)
            for variable, points in own.items()
        }
        for condition, own in result.items()
    }


def test_other_laboratories_slow_walks_are_met_from_their_own_comfortable_ones() -> None:
    sets = other_sets()
    rows = []
    for title, usual, slow, v0, v in (
        ("83 children, v* 0.17", "schwartz2008 free", "schwartz2008 very_slow", 0.429, 0.172),
        ("83 children, v* 0.29", "schwartz2008 free", "schwartz2008 slow", 0.429, 0.290),
        ("20 adults, v* 0.29", "bovi2011 natural", "bovi2011 xs", 0.425, 0.293),
    ):
        cells = []
        for variable, limit in CROSS_LIMIT_DEG.items():
            base, target = sets[usual][variable], sets[slow][variable]
            moved = move_curve(base, curve_models()[variable], v, v0)
            initial, final = (float(np.sqrt(np.mean((x - target) ** 2))) for x in (base, moved))
            cells.append(f"{initial:.1f} → {final:.1f}")
            assert final < min(initial, limit), (title, variable)
        rows.append([title, *cells])
    record(
        "Norm at the person's speed: other laboratories",
        ["people", *(v.replace("_", " ") + " °" for v in CROSS_LIMIT_DEG)],
        [*rows, ["limit", *(f"{x:g}" for x in CROSS_LIMIT_DEG.values())]],
        "RMS of their slow mean curve from their comfortable one, as it is → moved by the model. Children of "
        "Schwartz et al. 2008, adults of Bovi et al. 2011.",
    )
