"""The body that most tests here search for."""

import pytest

from studio.body.catalogue import load_body
from studio.body.model import BodyModel


@pytest.fixture(scope="session")
def body() -> BodyModel:
    """A person of 31 parameters."""
    return load_body("human31")
