"""The toy arena, which no test changes."""

import pytest
from toy_arena import ToyArena, make_arena


@pytest.fixture(scope="session")
def arena(tmp_path_factory: pytest.TempPathFactory) -> ToyArena:
    return make_arena(tmp_path_factory.mktemp("arena"))
