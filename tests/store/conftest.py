"""Fixtures of the store's tests."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mdstopo.case.model import Case
from tests.fakes import hand_made_case


@pytest.fixture
def case() -> Case:
    return hand_made_case()


@pytest.fixture
def notices() -> list[str]:
    return []


@pytest.fixture
def make_result(tmp_path: Path) -> Callable[..., Path]:
    """Writes a small result file and returns its path."""
    from mdstopo.store.atomic import replace_file
    from mdstopo.store.contents import Contents, case_part, result_image

    def make(status: str = "converged", kind: str = "run", name: str = "probe.h5", **changes: Any) -> Path:
        case = hand_made_case(**changes)
        datasets = case_part(case) | {
            "design/alpha": np.linspace(0.1, 0.6, 6),
            "iterations/objectives": np.array([[3.0], [2.0]]),
            "optimizer/0/alpha": np.linspace(0.1, 0.6, 6),
        }
        path = tmp_path / name
        contents = Contents.begun(case, kind, "mdstopo run", datasets, {"seed": 3})
        replace_file(path, result_image(contents.now(status, "a reason", {})))
        return path

    return make
