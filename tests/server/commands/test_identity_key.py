"""`sagittal identity-key`."""

from __future__ import annotations

from typing import Literal

import pytest

from sagittal.server.clinic import identities
from sagittal.server.commands.identity_key import identity_key
from tests.faults.clinic import Clinic


def keep_name(clinic: Clinic) -> None:
    with clinic.db.write() as c:
        identities.change(c, clinic.settings.identity_key_file, None, clinic.patient.id, {"name": "Erika"})


def ask(
    clinic: Clinic,
    label: Literal["make", "change", "discard"],
    really: bool = False,
    without_key: bool = False,
) -> int:
    return identity_key(label, really=really, without_key=without_key, data_dir=clinic.folder)


def test_a_key_is_made_once(clinic: Clinic, capsys: pytest.CaptureFixture[str]) -> None:
    file = clinic.settings.identity_key_file
    assert ask(clinic, "make") == 0
    stdout = capsys.readouterr().out
    assert stdout.startswith(f"{file} holds the key ")
    content = file.read_bytes()
    assert ask(clinic, "make") == 1
    assert capsys.readouterr().out == ""
    assert file.read_bytes() == content


def test_a_changed_key_opens_the_names_that_the_old_one_opened(
    clinic: Clinic, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ask(clinic, "change") == 1
    assert "does not store names" in capsys.readouterr().err
    ask(clinic, "make")
    keep_name(clinic)
    capsys.readouterr()
    assert ask(clinic, "change") == 0
    assert capsys.readouterr().out.startswith("1 patients' names are encrypted by key ")
    with clinic.db.read() as c:
        assert identities.get(c, clinic.settings.identity_key_file, clinic.patient.id).name == "Erika"


def test_what_no_key_opens_is_listed_first_and_removed_only_for_good(
    clinic: Clinic, capsys: pytest.CaptureFixture[str]
) -> None:
    file = clinic.settings.identity_key_file
    ask(clinic, "make")
    keep_name(clinic)
    capsys.readouterr()
    assert ask(clinic, "discard") == 0
    assert capsys.readouterr().out == f"0 patients' names cannot be read with {file}.\n"
    file.unlink()
    lost = f"patient {clinic.patient.id}\n1 patients' names cannot be read with {file}"
    assert ask(clinic, "discard") == 0
    assert capsys.readouterr().out == f"{lost}; --really removes them for good.\n"
    assert ask(clinic, "discard", really=True) == 1
    assert "--without-key" in capsys.readouterr().err
    assert ask(clinic, "discard", really=True, without_key=True) == 0
    assert capsys.readouterr().out == f"{lost} and were removed.\n"
    assert ask(clinic, "discard") == 0
    assert capsys.readouterr().out.startswith("0 patients' names")
