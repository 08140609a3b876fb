"""The command line on real and simulated recordings, good and bad: exit codes, files, sentences."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.data import ROOT, data_folder
from tests.helpers.marks import slow_after

NEURA = {
    "subject": {"height_m": 1.70},
    "sensors": {
        "00B40B91": "pelvis",
        "00B40C45": "thigh_l",
        "00B40C3C": "thigh_r",
        "00B40BA5": "shank_l",
        "00B40C35": "shank_r",
        "00B40C55": "foot_l",
        "00B40C48": "foot_r",
        "00B40C44": None,
        "00B40C47": None,
        "00B40C49": None,
        "00B40C4A": None,
    },
}


def sagittal(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "sagittal.server.main", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        cwd=ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )


def rows(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(path.read_text("utf-8"))))


@pytest.mark.sweep
def test_another_estimator_and_a_config_file(tmp_path: Path) -> None:
    take = tmp_path / "take"
    assert sagittal("simulate", "--out", take, "--script", "comfortable").returncode == 0
    files = next(p for p in take.iterdir() if p.suffix == ".parquet")
    done = sagittal("analyse", files, "--out", tmp_path / "a", "--estimator", "l7s_2i")
    assert done.returncode == 0, done.stderr
    assert "Poses by L7S-2I" in done.stdout
    assert result(tmp_path / "a")["estimator"]["requested"] == "l7s_2i"
    config = tmp_path / "config.json"
    config.write_text('{"poses": {"estimator": "stance_foot_anchor"}}')
    done = sagittal("analyse", files, "--out", tmp_path / "b", "--config", config)
    assert "Poses by Orientations only" in done.stdout
    wrong = sagittal("analyse", files, "--out", tmp_path / "c", "--estimator", "guess")
    assert wrong.returncode == 1
    assert "unknown_estimator" in wrong.stderr
    config.write_text("[1]")
    wrong = sagittal("analyse", files, "--out", tmp_path / "c", "--config", config)
    assert "config_unreadable" in wrong.stderr


def result(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "analysis.json").read_text("utf-8"))
    return content


@pytest.fixture(scope="module")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("walk")
    done = sagittal("simulate", "--out", folder, "--script", "comfortable", "--seed", "7")
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture(scope="module")
def analysed(simulated: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    out = tmp_path_factory.mktemp("results") / "new" / "folder"
    done = sagittal("analyse", simulated / "recording.parquet", "--out", out)
    assert done.returncode == 0, done.stderr
    return out, done.stdout


@pytest.mark.slow
def test_simulated_walk_is_analysed_and_agrees_with_its_truth(
    simulated: Path, analysed: tuple[Path, str]
) -> None:
    out, _ = analysed
    found = pq.read_table(out / "angles.parquet").to_pydict()
    truth = pq.read_table(simulated / "truth" / "angles.parquet").to_pydict()
    assert {name for name in found if not name.endswith("_heading_deg")} == set(truth)
    np.testing.assert_allclose(found["t_s"], np.asarray(truth["t_s"])[: len(found["t_s"])], atol=1e-9)
    for name in ("hip_flexion_l_deg", "knee_flexion_r_deg", "ankle_dorsiflexion_l_deg"):
        error = np.asarray(found[name], float) - np.asarray(truth[name], float)[: len(found[name])]
        assert np.sqrt(np.mean(error**2)) < 2.0, name
    contacts = [e for e in rows(out / "events.csv") if e["kind"] == "ic"]
    true_contacts = np.array(
        [float(e["time_s"]) for e in rows(simulated / "truth" / "events.csv") if e["kind"] == "ic"]
    )
    late = [np.abs(true_contacts - float(e["time_s"])).min() for e in contacts]
    assert len(contacts) >= 0.9 * len(true_contacts)
    # the sole has touched when the foot begins to slap (validation/report.md, "Contacts on simulated walks")
    assert np.median(late) < 0.035


@pytest.mark.slow
def test_result_files_have_the_documented_columns(analysed: tuple[Path, str]) -> None:
    out, stdout = analysed
    content = result(out)
    assert content["schema"] == 1
    assert {"quality", "calibration", "parameters", "warnings", "provenance"} <= set(content)
    for row in content["parameters"]:
        assert {"name", "side", "n", "mean", "sd", "unit", "reason"} <= set(row)
        assert (row["mean"] is None) == (row["reason"] is not None)
    assert list(rows(out / "events.csv")[0]) == [
        "time_s", "side", "kind", "source", "confidence", "uncertainty_s",
    ]  # fmt: skip
    stride = rows(out / "strides.csv")[0]
    assert {"side", "start_s", "tc_s", "end_s", "stride_time_s", "excluded_reason"} <= set(stride)
    assert "stride_time_s" in stdout
    assert set(content["provenance"]) >= {"input_sha256", "parameters_sha256", "version"}


@pytest.mark.sweep
def test_same_input_gives_the_same_bytes(simulated: Path, analysed: tuple[Path, str], tmp_path: Path) -> None:
    again = sagittal("analyse", simulated / "recording.parquet", "--out", tmp_path)
    assert again.returncode == 0
    for path in analysed[0].iterdir():
        assert path.read_bytes() == (tmp_path / path.name).read_bytes(), path.name


@pytest.mark.slow
def test_an_unknown_script_is_a_usage_error_that_names_the_scripts(tmp_path: Path) -> None:
    done = sagittal("simulate", "--out", tmp_path, "--script", "moonwalk")
    assert done.returncode == 2
    assert "moonwalk" in done.stderr
    assert "comfortable" in done.stderr


def test_wrong_words_are_a_usage_error() -> None:
    assert sagittal("analyse").returncode == 2
    assert sagittal("dance").returncode == 2


@pytest.mark.recorded
def test_neura_walk_in_every_packing_gives_the_same_numbers(tmp_path: Path) -> None:
    folder = data_folder("neura_walk", "rawimu")
    manifest = tmp_path / "manifest.json"
    manifest.write_text(json.dumps(NEURA), "utf-8")
    files = sorted(folder.glob("*.txt"))
    packed = tmp_path / "aufnahme 🚶.zip"
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in files:
            archive.write(file, file.name)
    found: list[Any] = []
    for name, paths in (("folder", [folder]), ("files", files), ("zip", [packed])):
        done = sagittal("analyse", *paths, "--manifest", manifest, "--out", tmp_path / name)
        assert done.returncode == 0, done.stderr
        found.append(result(tmp_path / name))
    assert found[0]["parameters"] == found[1]["parameters"] == found[2]["parameters"]
    copies = [w for w in found[0]["warnings"] if w["code"] == "duplicate_stream"]
    assert len(copies) == 2
    assert {s["side"] for s in found[0]["parameters"] if s["name"] == "stride_time_s" and s["n"] > 0} == {
        "left",
        "right",
    }


def mt_text(samples: Mapping[str, np.ndarray], rate: str = "100.0Hz") -> str:
    columns = "\t".join(["PacketCounter", "SampleTimeFine", *samples])
    body = "\n".join(
        f"{i}\t\t" + "\t".join(f"{v:.6f}" for v in values)
        for i, values in enumerate(zip(*samples.values(), strict=True))
    )
    return f"// Start Time: Unknown\n// Update Rate: {rate}\n// Firmware Version: 4\n{columns}\n{body}\n"


def standing(n: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(1)
    names = ["Acc_X", "Acc_Y", "Acc_Z", "Gyr_X", "Gyr_Y", "Gyr_Z"]
    values = {name: rng.normal(0, 0.01, n) for name in names}
    values["Acc_Z"] = values["Acc_Z"] + 9.81
    return values


BAD = {
    "empty file": ("a_00B40001.txt", b"", "empty"),
    "wrong format": ("a_00B40001.txt", b"\x89PNG\r\n\x1a\n" + bytes(200), "unknown_format"),
    "three seconds": ("a_00B40001.txt", mt_text(standing(300)).encode(), ""),
    "no walking": ("a_00B40001.txt", mt_text(standing(3000)).encode(), ""),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", slow_after(1, list(BAD)))
def test_nothing_analysable_is_exit_1_with_a_sentence(case: str, tmp_path: Path) -> None:
    name, content, code = BAD[case]
    (tmp_path / name).write_bytes(content)
    manifest = tmp_path / "m.json"
    manifest.write_text(json.dumps({"sensors": {"00B40001": "foot_l"}}), "utf-8")
    done = sagittal("analyse", tmp_path / name, "--manifest", manifest, "--out", tmp_path / "out")
    assert done.returncode == 1, done.stdout
    said = done.stderr + done.stdout
    assert code in said
    assert "Traceback" not in said
    assert len(said.strip()) > 40


@pytest.mark.slow
def test_missing_path_and_broken_manifest_are_named(tmp_path: Path) -> None:
    gone = sagittal("analyse", tmp_path / "nowhere", "--out", tmp_path / "out")
    assert gone.returncode == 1
    assert "nowhere" in gone.stderr
    (tmp_path / "a_00B40001.txt").write_text(mt_text(standing(2000)), "utf-8")
    (tmp_path / "m.json").write_text('{"sensors": {"00B40001": "nose"}}', "utf-8")
    wrong = sagittal("analyse", tmp_path, "--manifest", tmp_path / "m.json", "--out", tmp_path / "out")
    assert wrong.returncode == 1
    assert "nose" in wrong.stderr
    missing = sagittal("analyse", tmp_path, "--manifest", tmp_path / "none.json", "--out", tmp_path / "out")
    assert missing.returncode == 1
    assert "none.json cannot be read" in missing.stderr
    assert "Traceback" not in missing.stderr
