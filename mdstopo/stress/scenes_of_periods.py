"""Very many periods: what is kept of the energy, and how late the motion is."""

import json
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.case.reader import read_case
from mdstopo.stress.measuring import ADAPTIVE, ball, moved, spring
from mdstopo.stress.scene import Scene

if TYPE_CHECKING:
    from mdstopo.case.model import Case

PERIOD = 2.0 * np.pi
AMPLITUDE = 0.4
#: periods of one simulation: a motion may have a million steps, and every step is kept
PIECE = 5_000


def swing(periods: int, x: float = 1.0, v: float = AMPLITUDE, **solver: Any) -> dict[str, Any]:
    """A body of 1 kg on a spring of 1 N/m, which swings 0.4 m to either side, from a place and a speed."""
    return {
        "time": {"end": periods * PERIOD},
        "bodies": {"ball": ball(x, velocity=[v, 0.0])},
        "members": {"spring": spring([0.0, 0.0], "ball", [x, 0.0], stiffness=1.0, free_length=1.0)},
        "solver": solver,
    }


def _drift(periods: int, solver: dict[str, Any], case: "Case") -> tuple[float, str]:
    """Drift of the energy over pieces that each start where the one before ended; the phase at the end in words."""
    x, v, done, worst = 1.0, AMPLITUDE, 0, 0.0
    while done < periods:
        count = min(PIECE, periods - done)
        if done:
            case = read_case(json.dumps({"format": 1, **swing(count, x, v, **solver)}))
        motion = moved(case)
        energy = motion.v[:, 0] ** 2 + (motion.q[:, 0] - 1.0) ** 2
        worst = max(worst, float(np.abs(energy / AMPLITUDE**2 - 1.0).max()))
        x, v, done = float(motion.q[-1, 0]), float(motion.v[-1, 0]), done + count
    late = -np.arctan2(x - 1.0, v)
    return worst, f"phase error {late:.1e} rad"


def scenes() -> list[Scene]:
    """Ten thousand periods, and a million on demand."""
    found = []
    for integrator in ADAPTIVE:
        solver: dict[str, Any] = {"integrator": integrator, "tolerance": 1e-12}
        for periods, words, long in ((10_000, "ten thousand", False), (1_000_000, "a million", True)):
            found.append(
                Scene(
                    f"periods-{periods}-{integrator}".replace("_", "-"),
                    f"{words} periods of a swing at a tolerance of 1e-12: energy",
                    swing(min(periods, PIECE), **solver),
                    partial(_drift, periods, solver),
                    bound=1e-8 if long else 1e-10,
                    limit=3600.0 if long else 120.0,
                    long=long,
                )
            )
    return found
