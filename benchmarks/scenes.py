"""The scenes and designs that are measured.

fig6          the paper's Section IV.A: the energy is highest at the end
end           the same, the energy looked at when time is over
interior      the same bodies pulled sideways for twice as long: the peak lies inside the interval
interior_end  the same, the energy looked at when time is over: no peak has to be found
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mdstopo import Case, load_case

CASES = Path(__file__).resolve().parent.parent / "cases"

DESIGNS = ("uniform", "random")
SCENES = ("fig6", "interior")

#: scale of the hypervolume of cases/fig7.yaml, volume spent, and the best known of it (up to 1.1)
IDEAL, NADIR, BEST_KNOWN = np.array([16.48, 35.19]), np.array([51.67, 122.87]), 0.9546

_AT_END: dict[str, object] = {"objectives.G.over_time": "final"}
_PULLED: dict[str, object] = {"time.end": 0.4, "loads": [{"body": "vehicle", "acceleration": [20, 0]}]}
_CHANGES: dict[str, dict[str, object]] = {
    "fig6": {},
    "end": _AT_END,
    "interior": _PULLED,
    "interior_end": {**_PULLED, **_AT_END},
}


def scene(name: str, **solver: object) -> Case:
    """A scene with solver settings of its own."""
    settings = {f"solver.{key}": value for key, value in solver.items()}
    return load_case(CASES / "fig6.yaml", overrides={**_CHANGES[name], **settings})


def design(name: str, n: int) -> NDArray[np.float64]:
    """`uniform`: 0.1 everywhere; `ones`: every member whole; `random`: between 0.01 and 1."""
    if name in ("uniform", "ones"):
        return np.full(n, 0.1 if name == "uniform" else 1.0)
    return np.random.default_rng(7).uniform(0.01, 1.0, n)
