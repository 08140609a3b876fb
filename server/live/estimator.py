"""Estimator process: processes many live trials without access to the database; ends with its parent.

Started by server/live/pool.py as `python -m sagittal.server.live.estimator <socket> <parent pid>`.
"""

from __future__ import annotations

import gc
import logging
import select
import time
from collections.abc import Callable
from math import ceil

from sagittal.core.errors import SagittalError
from sagittal.server.live import follower
from sagittal.server.live.follower import Follower
from sagittal.server.live.messages import (
    Charge,
    Command,
    EstimateFailed,
    EstimatorReady,
    FollowTake,
    ForgetTake,
    LogGrown,
    Order,
    Report,
    decode_order,
    encode,
)
from sagittal.server.processes.channel import Channel
from sagittal.server.processes.child import enter_child

log = logging.getLogger("sagittal.server.live.estimator")


class EstimatorWorker:
    """The live trials of this process; one that raises is dropped without affecting the others."""

    def __init__(self, say: Callable[[Report], None]) -> None:
        self._say = say
        self._takes: dict[str, Follower] = {}

    @property
    def has_work(self) -> bool:
        """Whether any log has unread data."""
        return any(take.has_work for take in self._takes.values())

    @property
    def due_at(self) -> float | None:
        """Time of the next picture."""
        return min((due for t in self._takes.values() if (due := t.due_at) is not None), default=None)

    def obey(self, order: Order) -> None:
        """Carry out one order; orders for dropped trials are ignored."""
        match order:
            case FollowTake():
                self._drop(order.take)
                self._guarded(order.take, lambda: self._begin(order))
            case LogGrown():
                for take, size in order.sizes.items():
                    if take in self._takes:
                        self._takes[take].grow(size, order.at)
            case Command() if order.take in self._takes:
                self._guarded(order.take, lambda: self._takes[order.take].command(order))
            case Charge() if order.take in self._takes:
                self._takes[order.take].charge(order.percent)
            case ForgetTake():
                self._drop(order.take)

    def work(self) -> None:
        """Process one part of each log and send due pictures."""
        for name, take in list(self._takes.items()):
            if take.has_work:
                self._guarded(name, take.step)
        self.show()

    def show(self) -> None:
        """Send the pictures that are due."""
        for name, take in list(self._takes.items()):
            self._guarded(name, take.show)

    def _begin(self, order: FollowTake) -> None:
        self._takes[order.take] = Follower(order, self._say)

    def _drop(self, take: str) -> None:
        follower = self._takes.pop(take, None)
        if follower is not None:
            follower.close()

    def _guarded(self, take: str, action: Callable[[], None]) -> None:
        try:
            action()
        except (BrokenPipeError, ConnectionError):
            raise
        except Exception as error:
            if not isinstance(error, SagittalError):
                log.exception("the estimate of live take %s failed", take)
            self._drop(take)
            notice = follower.describe_failure(error)
            self._say(EstimateFailed(take, notice.code, notice.message))


def main() -> None:
    """Process trials until the web process closes the socket."""
    line, _ = enter_child()
    compile_kernels()
    gc.collect()
    gc.freeze()  # exclude library objects from garbage collection, which would cost 50 ms per trial
    line.send(encode(EstimatorReady()))
    try:
        follow(line)
    except (EOFError, BrokenPipeError, ConnectionError):
        return


def follow(line: Channel) -> None:
    """Alternate between orders and logs; raises EOFError if the peer has closed."""
    estimator = EstimatorWorker(lambda report: line.send(encode(report)))
    # one shared poll object, as this is called hundreds of times a second
    orders = select.poll()
    orders.register(line.fileno(), select.POLLIN)
    while True:
        wait: float | None = 0.0
        if not estimator.has_work:
            due = estimator.due_at
            wait = None if due is None else max(0.0, due - time.monotonic())
        # all pending orders first, so that new data are read at once
        while orders.poll(None if wait is None else ceil(1000.0 * wait)):
            estimator.obey(decode_order(line.receive()))
            wait = 0.0
        estimator.work()


def compile_kernels() -> None:
    """Compile the kernels or load them from the cache, before the first trial."""
    from sagittal.core.online import compile_live_kernels
    from sagittal.server.processes.compiling import OFFLINE, compile_filters_once

    # filters of a walk first: workers can analyse while the rest is compiled here
    compile_filters_once(OFFLINE)
    compile_live_kernels()


if __name__ == "__main__":
    main()
