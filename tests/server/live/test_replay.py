"""`sagittal replay` from files on the disk to a recording of a running server."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from sagittal.core.simulate import mt_files, simulate_scenario
from sagittal.server.live_takes import live
from sagittal.server.main import main
from tests.helpers.clinic import Clinic
from tests.helpers.live_clinic import new_session

pytestmark = pytest.mark.anyio


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of MT Manager files with a manifest."""
    simulation = simulate_scenario("comfortable", 3)
    path = tmp_path_factory.mktemp("take")
    for name, content in mt_files(simulation.recording, "walk", simulation.first_counter).items():
        (path / name).write_bytes(content)
    sensors = ",".join(f'"{d}":"{s}"' for d, s in simulation.recording.segments.items())
    (path / "manifest.json").write_text(f'{{"sensors":{{{sensors}}}}}')
    return path


def open_code(clinic: Clinic) -> tuple[str, str]:
    session = new_session(clinic)
    with clinic.db.write() as c:
        take, code = live.open_take(c, None, session)
    return take.id, code


async def run(*words: str) -> int:
    return await asyncio.to_thread(main, ["replay", *words])


@pytest.mark.slow
async def test_a_folder_is_replayed_through_a_bad_network(
    clinic: Clinic, port: int, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    take, code = open_code(clinic)
    words = ("--speed", "0", "--drop", "0.03", "--jitter", "1", "--batch", "25")
    assert await run(str(folder), "--to", f"http://127.0.0.1:{port}", "--code", code.lower(), *words) == 0
    stdout = capsys.readouterr().out
    assert "Streaming 7 sensors" in stdout
    assert "Finished as recording" in stdout
    with clinic.db.read() as c:
        row = live.get(c, take)
    assert (row.state, row.source, row.problem) == ("finished", "cli", None)
    assert row.count
    assert f"{row.count} of {row.count} batches acknowledged" in stdout
    assert row.recording_id is not None
    assert row.recording_id in stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("--code", "ZZZZZZ"), "code_not_valid"),
        (("--speed", "-1"), "bad_option"),
        (("--speed", "nan"), "bad_option"),
        (("--drop", "1"), "bad_option"),
        (("--jitter", "-3"), "bad_option"),
        (("--batch", "0"), "batch_size"),
        (("--manifest", "absent.json"), "file_not_found"),
        (("--to", "127.0.0.1:9"), "unreachable"),
        (("--to", "ftp://there"), "bad_address"),
    ],
)
async def test_what_cannot_be_replayed_says_why(
    clinic: Clinic,
    port: int,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    words: tuple[str, ...],
    code: str,
) -> None:
    inputs = {"--to": f"http://127.0.0.1:{port}", "--code": "ABCDEF"} | dict(
        zip(words[::2], words[1::2], strict=True)
    )
    assert await run(str(folder), *[x for pair in inputs.items() for x in pair]) == 1
    assert f"Not replayed ({code}): " in capsys.readouterr().err
