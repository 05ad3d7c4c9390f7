"""The body that most tests here search for; what likelihoods' tests weigh is found here, too."""

import sys
from pathlib import Path

import pytest

from studio.body.catalogue import load_body
from studio.body.model import BodyModel

sys.path.append(str(Path(__file__).parents[1] / "likelihood"))


@pytest.fixture(scope="session")
def body() -> BodyModel:
    """A person of 31 parameters."""
    return load_body("human31")
