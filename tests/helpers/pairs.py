"""Paired timing: subject and yardstick alternate so that both meet the same machine load."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

Work = Callable[[], Any]


def cpu_s(work: Work) -> float:
    """CPU seconds that this process spends on a piece of work, all its threads together."""
    began = time.process_time()
    work()
    return time.process_time() - began


def in_pairs(ours: Work, yardstick: Work, times: int = 7) -> tuple[float, float, float]:
    """Median CPU seconds of both, and the median of `ours` over `yardstick` within each pair."""
    pairs = [(cpu_s(ours), cpu_s(yardstick)) for _ in range(times)]
    a, b = (statistics.median(column) for column in zip(*pairs, strict=True))
    return a, b, statistics.median(x / y for x, y in pairs)


def plain_python() -> int:
    """A fixed piece of interpreted work, some 40 ms on a quiet core: what this machine can do right now."""
    result: dict[int, tuple[float, float]] = {}
    for i in range(100_000):
        x = 0.5 * i
        result[i % 1000] = (x, x * x - result.get((i + 1) % 1000, (0.0, 0.0))[0])
    return len(result)
