"""The validation runs by part, resumes and reports failures."""

from __future__ import annotations

from pathlib import Path

import pytest

from validation.__main__ import Unit, list_units, parse, run

PASSES = "def test_passes(): assert True\n"
FAILS = "def test_fails(): assert False\n"


def write_unit(tmp_path: Path, name: str, source: str, *, alone: bool = False) -> Unit:
    path = tmp_path / f"test_{name}.py"
    path.write_text(source, encoding="utf-8")
    return Unit(
        "accuracy",
        name,
        (str(path), "-c", "/dev/null", "--rootdir", str(tmp_path), "-p", "no:schemathesis"),
        alone,
    )


@pytest.mark.slow
def test_a_run_resumes_and_repeats_only_failures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("validation.__main__.hash_code", lambda: "code")
    store = tmp_path / "store"
    units = [write_unit(tmp_path, "a", PASSES), write_unit(tmp_path, "b", FAILS, alone=True)]
    first = run(units, store, whole=True, again=False, jobs=2, seconds=600.0)
    assert [r.outcome for r in first] == ["passed", "failed"]
    assert "assert False" in capsys.readouterr().out
    write_unit(tmp_path, "b", PASSES)
    second = run(units, store, whole=True, again=False, jobs=2, seconds=600.0)
    assert [r.outcome for r in second] == ["passed", "passed"]
    assert "skipped, passed on the same code: a" in capsys.readouterr().out
    assert second[0] == first[0]


def test_no_unit_is_started_when_time_is_up(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    units = [write_unit(tmp_path, "a", PASSES)]
    assert run(units, tmp_path / "store", whole=True, again=False, jobs=1, seconds=-1.0) == []
    assert "time is up: a" in capsys.readouterr().out


def test_every_study_is_a_unit_of_one_name() -> None:
    units = list_units()
    assert len({(u.part, u.name) for u in units}) == len(units)
    assert {"accuracy", "bench", "faults", "sweep", "browser", "postgresql"} == {u.part for u in units}


def test_an_unknown_part_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse(["acuracy"])
    assert "no part or unit is called acuracy" in capsys.readouterr().err
