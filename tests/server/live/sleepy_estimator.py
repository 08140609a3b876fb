"""The estimator process, but each time it reads it sleeps first."""

from __future__ import annotations

import time

from sagittal.server.live import estimator
from sagittal.server.live.follower import Follower

SLEEP_S = 0.6


class Sleepy(Follower):
    """Estimator that is always half a second late."""

    def step(self) -> None:
        """Sleep, then read."""
        time.sleep(SLEEP_S)
        super().step()


if __name__ == "__main__":
    setattr(estimator, "Follower", Sleepy)  # noqa: B010 - the name is the estimator's own
    estimator.main()
