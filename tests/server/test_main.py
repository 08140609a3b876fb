"""Command line: help, and responses to invalid arguments."""

from __future__ import annotations

import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

from sagittal.server.main import COMMANDS, find_module, main, make_app

HEAVY = ("numba", "numpy", "pyarrow", "pydantic", "sqlalchemy", "fastapi", "docutils")


@pytest.mark.parametrize("word", ["--help", "--version"])
def test_help_and_version_load_nothing_heavy(word: str) -> None:
    code = (
        "import sys; from sagittal.server.main import main; code = main([sys.argv[1]]); "
        "sys.stderr.write(' '.join(sys.modules)); raise SystemExit(code)"
    )
    done = subprocess.run([sys.executable, "-c", code, word], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("Usage: sagittal" if word == "--help" else "sagittal ")
    assert not {*HEAVY} & {*done.stderr.split()}


def test_no_command_loads_numba_before_it_runs() -> None:
    """Its folder of compiled filters is chosen between the two."""
    code = "import sys; from sagittal.server.main import *; app = make_app(); [app[n] for n in COMMANDS]; "
    code += "assert app['tune'].default_command; raise SystemExit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_says_what_it_takes(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([name, "--help"]) == 0
    message = re.sub(r"\s+", " ", capsys.readouterr().out)
    assert COMMANDS[name] in message
    function = name.replace("-", "_")
    module = importlib.import_module(find_module(name))
    for parameter in inspect.signature(getattr(module, function)).parameters.values():
        is_option = parameter.kind is inspect.Parameter.KEYWORD_ONLY
        assert ("--" in message) if is_option else (parameter.name.upper() in message)


WRONG = {
    (): "A command is missing",
    ("dance",): 'Unknown command "dance"',
    ("analyse",): "PATHS requires an argument",
    ("keygen",): "PATH requires an argument",
    ("serve", "--port", "1.5"): "'1.5' is no whole number",
    ("simulate", "--out", "x", "--seed", "-1"): "'-1' is no whole number of 0 or more",
    ("serve", "--nope"): "Unknown option: --nope",
    ("user", "anna", "--role", "king"): 'Invalid value "king" for --role',
    ("stairs", "x", "--level", "1"): "--level requires 2",
    ("trash", "--no-restore"): "Unknown option: --no-restore",
}


@pytest.mark.parametrize("words", WRONG, ids=" ".join)
def test_wrong_words_are_one_sentence_and_exit_2(
    words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert WRONG[words] in err
    assert err.count("\n") == 1
    assert "--help` says what is possible." in err
    assert not out


def test_values_come_before_and_after_what_has_no_name() -> None:
    words = ["tune", "--validate", "a", "b", "--no-magnetometer", "--algorithm", "m", "d"]
    _, inputs, _ = make_app().parse_args(words, exit_on_error=False)
    assert inputs.args == (Path("d"),)
    assert inputs.kwargs == {"validation": ("a", "b"), "magnetometer": False, "algorithm": "m"}
    _, inputs, _ = make_app().parse_args(
        ["stairs", "a", "b", "--level", "-1", "2", "--up", "0", "1", "--down=3", "4", "--out", "x"]
    )
    assert inputs.args == ([Path("a"), Path("b")],)
    assert inputs.kwargs["level"] == (-1.0, 2.0)
