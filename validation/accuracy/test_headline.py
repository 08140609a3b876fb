"""The headline of the twelve virtual people names the commanded deviation, and none for the healthy one.

Each run covers half of them; `--write-figures` runs all.
"""

from __future__ import annotations

import re

import pytest

from sagittal.core.simulate import PATIENTS
from sagittal.server.report.files.bundle import load_bundle
from sagittal.server.report.files.exports import analysis_files
from sagittal.server.report.view.headline import Headline
from sagittal.server.report.view.model import report_model
from tests.helpers.walks import analysed
from validation.marks import sample

SIGNATURES: dict[str, tuple[str, ...]] = {
    "healthy": (),
    "healthy_slow": ("Gait speed is below normal",),
    "hemiparetic": (
        "Circumduction .* more on the left", "Stance phase .* left", "Knee flexion in swing is .* left",
    ),
    "hemi_mild": (
        "Circumduction .* more on the left", "Stance phase .* left", "Foot angle at contact is .* left",
    ),
    "stiff_knee": ("Knee flexion in swing is .* less on the left",),
    "drop_foot": ("Ankle dorsiflexion in swing .* less on the left", "Foot angle at contact .* left"),
    "crouch": ("Knee range of motion is reduced on both sides",),
    "antalgic": ("Stance phase is .* shorter on the left", "Step time is .* on the right"),
    "parkinson": ("Steps are short and quick",),
    "severe_shuffle": ("Cadence is above normal",),
    "step_asym": ("Step length is .* on the left",),
    "elderly": ("Gait speed is below normal",),
}  # fmt: skip
"""Patterns of sentences that must be among those shown."""

SHOWN_OF_SLOW = {"speed", "support"}
"""What a healthy person who was told to walk slowly may be told; the simulation does not lengthen stance."""


def headline_of(name: str) -> Headline:
    bundle = load_bundle(analysis_files(analysed(name, 0)))
    headline = report_model(bundle, age=45, sex="male", height_m=1.75).headline
    assert headline is not None
    return headline


@pytest.mark.parametrize("name", sample(sorted(PATIENTS), 2))
def test_the_headline_names_the_signature(name: str) -> None:
    headline = headline_of(name)
    texts = [s.text for s in headline.shown]
    for part in SIGNATURES[name]:
        assert any(re.search(part, text) for text in texts), texts
    if name == "healthy":
        assert headline.stands_out == ()
        assert headline.looked_at >= 10
    if name == "healthy_slow":
        assert {s.family for s in headline.stands_out} <= SHOWN_OF_SLOW


def test_every_virtual_person_has_a_signature() -> None:
    assert set(SIGNATURES) == set(PATIENTS)
