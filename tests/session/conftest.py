"""Fixtures of the tests of runs."""

import pytest

from mdstopo.case.model import Case
from tests.fakes import hand_made_case


@pytest.fixture
def case() -> Case:
    return hand_made_case()


@pytest.fixture
def notices() -> list[str]:
    return []
