"""What the tests of scenes in space share."""

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import mdstopo

CASES = Path(__file__).parent / "cases"


def load(name, **overrides):
    """A case of this folder, with overrides of the solver's keys."""
    return mdstopo.load_case(
        CASES / f"{name}.yaml", overrides={f"solver.{key}": str(value) for key, value in overrides.items()}
    )


def attitudes(q, body):
    """Rotations (T,) of a body's own axes at states q (T, 7 n_bodies)."""
    return Rotation.from_quat(np.roll(q[:, 7 * body + 3 : 7 * body + 7], -1, axis=1))
