"""Floor contact of each foot as masks, from the times of initial and terminal contact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sagittal.core.frames import Bools, Floats


def contact_mask(t_s: Floats, ic_s: Sequence[float], tc_s: Sequence[float]) -> Bools:
    """Samples (n,) with a foot on the floor: from each initial contact to the next terminal contact.

    Before its first event a foot is on the floor if that event is a terminal contact, after its last if that
    is an initial contact. Between two terminal contacts without an initial one (a missed event) the swing is
    assumed to last until half way.

    Parameters
    ----------
    t_s : (n,) increasing, s. ic_s, tc_s : event times of one foot, s, increasing.
    """
    events = sorted([(t, True) for t in ic_s] + [(t, False) for t in tc_s])
    if not events:
        return np.ones(len(t_s), bool)
    contact = np.full(len(t_s), not events[0][1])
    starts = np.searchsorted(t_s, [t for t, _ in events])
    for (start, down), first, (next_s, landed), past in zip(
        events, starts, [*events[1:], (np.inf, True)], [*starts[1:], len(t_s)], strict=True
    ):
        contact[first:past] = down
        if not down and not landed:
            contact[max(first, np.searchsorted(t_s, 0.5 * (start + next_s))) : past] = True
    return contact
