"""Which start of which web server has a live take: the fence between a server and its own later start."""

from __future__ import annotations

from sqlalchemy import Connection, update

from sagittal.server.errors import NodeAway
from sagittal.server.live_takes.live import LiveTakeRecord, TakeOwner, get
from sagittal.server.storage.live_tables import live_take


def claim_take(c: Connection, take_id: str, owner: TakeOwner) -> LiveTakeRecord:
    """Note that this start of a web server has a take from now on; raises NotFound, NodeAway.

    What a later start of it has claimed stays that one's.
    """
    this = get(c, take_id)
    owner.require(this)
    if owner.node is not None and this.node_run is not None and this.node_run > (owner.run or 0):
        raise NodeAway(this.node)
    mine = live_take.c.id == take_id
    c.execute(update(live_take).where(mine).values(node=owner.node, node_run=owner.run))
    return get(c, take_id)
