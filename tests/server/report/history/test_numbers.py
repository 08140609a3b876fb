"""Numbers of a walk: the means that analysis.json keeps are those of its angles."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np

from sagittal.server.report.files.bundle import load_bundle
from sagittal.server.report.history.numbers import means_of, read_means
from tests.server import analysed


def test_kept_means_are_those_of_the_angles() -> None:
    files = analysed.files()
    stored_means, means = read_means(files["analysis.json"]), means_of(load_bundle(files))
    assert stored_means is not None
    assert stored_means.parameters == means.parameters
    assert {side: set(own) for side, own in stored_means.curves.items()} == {
        side: set(own) for side, own in means.curves.items()
    }
    assert len(means.curves["left"]) > 5
    for side, own in means.curves.items():
        for variable, curve in own.items():
            # angles.parquet has single precision
            np.testing.assert_allclose(stored_means.curves[side][variable], curve, atol=3e-5)


def test_without_a_standing_there_is_no_level_and_an_earlier_version_kept_none() -> None:
    files = analysed.files()
    bundle = load_bundle(files)
    assert bundle.angles is not None
    assert means_of(replace(bundle, angles=replace(bundle.angles, zero="walking"))).curves == {}
    data = json.loads(files["analysis.json"])
    del data["mean_curves"]
    assert read_means(json.dumps(data).encode()) is None


def test_a_curve_with_a_gap_keeps_it() -> None:
    data = json.loads(analysed.files()["analysis.json"])
    data["mean_curves"]["left"]["knee_flexion"][3] = None
    stored_means = read_means(json.dumps(data).encode())
    assert stored_means is not None
    assert np.flatnonzero(np.isnan(stored_means.curves["left"]["knee_flexion"])).tolist() == [3]
