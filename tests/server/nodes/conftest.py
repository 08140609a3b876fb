from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.helpers.postgres import NoPostgresError, make_lasting_database
from tests.server.nodes.pair import NodePair, serving_pair


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[NodePair]:
    try:
        url = make_lasting_database()
    except NoPostgresError as error:
        pytest.skip(str(error))
    with serving_pair(tmp_path_factory.mktemp("clinic"), url) as running:
        yield running
