"""How soon a session page is there, from a real server on loopback."""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path

import pytest

from core.simulate import mt_files, simulate_scenario
from tests.service import new_session, served, upload, wait_for

LESS = 3
"""Times that fewer bytes go over the network than the page has; measured: 5."""


@pytest.mark.bench
def test_session_page_comes_within_a_second_and_less_than_its_analysis(tmp_path: Path) -> None:
    made = simulate_scenario("comfortable", 3)
    with served(tmp_path / "data") as service:
        client = service.client
        session = new_session(client, "P-1")
        for name, content in mt_files(made.recording, "walk", made.first_counter).items():
            upload(client, session, name, content)
        client.put(f"/api/v1/sessions/{session}/manifest", json={"sensors": dict(made.recording.segments)})
        job = client.post(f"/api/v1/sessions/{session}/analyses", json={}).raise_for_status().json()
        assert wait_for(client, job["id"])["state"] == "done"
        first: list[float] = []
        whole: list[float] = []
        for _ in range(7):
            began = time.perf_counter()
            with client.stream("GET", f"/sessions/{session}") as answer:
                answer.raise_for_status()
                chunks = answer.iter_bytes()
                size = len(next(chunks))
                first.append(time.perf_counter() - began)
                size += sum(map(len, chunks))
                whole.append(time.perf_counter() - began)
                sent = answer.num_bytes_downloaded
    sys.stdout.write(f"first bytes {first}, whole {whole} s, {size} bytes as {sent}\n")
    assert sent <= size / LESS
    assert statistics.median(first) <= 1.0
    assert statistics.median(whole) <= 1.0
