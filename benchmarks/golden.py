"""What must not change by a change of structure: values, gradients and iterates, kept to the last bit.

`python -m benchmarks golden --check FILE` computes everything that is kept in the file and tells what differs;
`--write FILE` keeps what is computed now. Kept are, for every case in `cases/`, each integrator but esdirk and each
sensitivity method that the case can use, objectives, constraints and gradients at one design; and the iterates of the
paper's scenes. Of cases in space, whose kernels compile for minutes, what `auto` chooses is kept.

Bits are the same only with the same processor and the same versions of the compiler (docs/accuracy.md). On others, what
is computed has to agree to the case's tolerance.
"""

import hashlib
import json
import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.scenes import CASES
from mdstopo import Case, evaluate, load_case, optimize
from mdstopo.api import METHODS as SENSITIVITIES
from mdstopo.bench.tables import Table, verdict
from mdstopo.case.methods.integrators import INTEGRATORS
from mdstopo.case.text.errors import CaseError
from mdstopo.compiler.store import SETTINGS
from mdstopo.installed import version_of

Floats = NDArray[np.float64]
#: what is kept of one item: arrays by name, each as `_kept` has it
Item = dict[str, dict[str, Any]]

#: steps of `generalized_alpha`
STEPS = 100
#: integrators that are left out: their kernels for all these cases compile for a minute
LEFT_OUT = ("esdirk",)
#: integrator and method for cases in space
IN_SPACE = "runge_kutta/adjoint"
#: cases of which one evaluation takes too long for a test
LONG = ("cargo",)
#: cases whose iterates are kept, and how many
ITERATED, ITERATIONS = ("fig6", "fig6-stiff", "fig7", "fig7-g1", "fig7-g2"), 30
#: where bits may differ: how many tolerances of the case values and gradients may differ by, relative to their size
VALUES, GRADIENTS = 10.0, 1000.0
#: the tolerance of iterates there, which stand at the end of a chain of decisions
ITERATES = 1e-3


@dataclass(frozen=True)
class Finding:
    """An item, compared.

    same: whether it is the same to the bit. error: the largest difference, relative to the array's size and in units of
    what may differ on another machine. what: the arrays that differ.
    """

    name: str
    same: bool
    error: float
    what: str

    @property
    def agrees(self) -> bool:
        """Whether it differs by no more than other processors may."""
        return self.error <= 1.0


def names() -> list[str]:
    """All items: CASE/INTEGRATOR/METHOD and CASE/iterates."""
    methods = [name for name in SENSITIVITIES if name != "auto"]
    integrators = [name for name in INTEGRATORS if name not in LEFT_OUT]
    ways = {2: [f"{integrator}/{method}" for integrator in integrators for method in methods], 3: [IN_SPACE]}
    cases = [load_case(path) for path in sorted(CASES.glob("*.yaml")) if path.stem not in LONG]
    single = [f"{case.name}/{way}" for case in cases for way in ways[case.dimension]]
    return single + [f"{case}/iterates" for case in ITERATED]


def computed(name: str) -> dict[str, Floats] | None:
    """The arrays of an item; None where the case cannot be computed in this way."""
    case, *how = name.split("/")
    if how == ["iterates"]:
        return _iterates(case)
    integrator, method = how
    path = CASES / f"{case}.yaml"
    overrides: dict[str, object] = {"solver.integrator": integrator}
    if integrator == "generalized_alpha":  # coarse: what is kept is what it computes, not how well
        overrides["solver.step"] = max(each.end - each.start for each in load_case(path).load_cases) / STEPS
    try:
        return _evaluated(load_case(path, overrides=overrides), method)
    except (CaseError, ValueError):  # such as `iterative` with another integrator than generalized_alpha
        return None


def tolerance_of(name: str) -> dict[str, float]:
    """What may differ where bits may, by the beginning of an array's name."""
    case, *how = name.split("/")
    if how == ["iterates"]:
        return {"": ITERATES}
    tolerance = load_case(CASES / f"{case}.yaml").solver.tolerance
    return {"gradient": GRADIENTS * tolerance, "": VALUES * tolerance}


def _evaluated(case: Case, method: str) -> dict[str, Floats]:
    """Values and gradients at a design that has no two members alike."""
    rng = np.random.default_rng(7)
    design = case.lower + (0.2 + 0.6 * rng.random(len(case.lower))) * (case.upper - case.lower)
    found = evaluate(case, design[: case.n_design], method=method)
    arrays = {
        "objectives": np.array(list(found.objectives.values())),
        "constraints": np.asarray(found.constraints, dtype=np.float64),
    }
    return arrays | {f"gradient of {each}": np.asarray(row) for each, row in found.gradients.items()}


def _iterates(case: str) -> dict[str, Floats]:
    """Objectives and last design of a short run."""
    stated = load_case(CASES / f"{case}.yaml", overrides={"optimizer.max_iterations": ITERATIONS})
    result = optimize(stated)
    return {
        "objectives by iteration": np.asarray(result.history["objectives"], dtype=np.float64).ravel(),
        "last design": np.asarray(result.alpha, dtype=np.float64),
    }


def machine() -> str:
    """What bits depend on: processor, the instructions that are used, and the versions that make the machine code."""
    from llvmlite.binding import get_host_cpu_features, get_host_cpu_name

    features = hashlib.sha256(get_host_cpu_features().flatten().encode()).hexdigest()[:12]
    stated = "".join(f", {key}={os.environ[key]}" for key in SETTINGS if key in os.environ)
    versions = ", ".join(f"{name} {version_of(name)}" for name in ("numpy", "scipy", "numba", "llvmlite"))
    return f"{get_host_cpu_name()} {features}, {platform.system()}, {versions}{stated}"


def _kept(array: Floats) -> dict[str, Any]:
    """An array in few numbers: a hash of its bytes, and its size and two products, for where bits may differ."""
    flat = np.ascontiguousarray(array, dtype=np.float64).ravel()
    usable = np.nan_to_num(flat, nan=0.0, posinf=0.0, neginf=0.0)
    rows = np.random.default_rng(len(flat)).standard_normal((2, len(flat)))
    return {
        "bytes": hashlib.sha256(flat.tobytes()).hexdigest()[:24],
        "length": len(flat),
        "numbers": [float(np.sqrt(usable @ usable)), *(float(row @ usable) for row in rows)],
    }


def read(file: Path) -> tuple[str, dict[str, Item]]:
    """On what machine the file was written, and its items."""
    data = json.loads(file.read_text(encoding="utf-8"))
    return data["machine"], data["items"]


def write(file: Path) -> None:
    """Keep what is computed now."""
    items = {}
    for name in names():
        arrays = computed(name)
        if arrays is not None:
            items[name] = {key: _kept(value) for key, value in arrays.items()}
    text = json.dumps({"machine": machine(), "items": items}, indent=1)
    file.write_text(text + "\n", encoding="utf-8")


def compare(name: str, kept: Item) -> Finding:
    """Compute an item again. The error is in units of what may differ on another machine."""
    arrays = computed(name)
    if arrays is None:
        return Finding(name, False, float("inf"), "cannot be computed any more")
    if list(arrays) != list(kept):
        return Finding(name, False, float("inf"), f"is {', '.join(arrays)}; was {', '.join(kept)}")
    now = {key: _kept(value) for key, value in arrays.items()}
    different = [key for key in kept if now[key]["bytes"] != kept[key]["bytes"]]
    error = max((_difference(now[key], kept[key]) / _allowed(name, key) for key in different), default=0.0)
    return Finding(name, not different, error, ", ".join(different))


def differing(file: Path, chosen: Sequence[str]) -> list[Finding]:
    """What differs of these items."""
    items = read(file)[1]
    return [each for each in (compare(name, items[name]) for name in chosen) if not each.same]


def _allowed(name: str, key: str) -> float:
    return next(value for begin, value in tolerance_of(name).items() if key.startswith(begin))


def _difference(now: Mapping[str, Any], kept: Mapping[str, Any]) -> float:
    """The largest difference of an array's numbers, relative to its size."""
    if now["length"] != kept["length"]:
        return float("inf")
    size = max(kept["numbers"][0], np.finfo(np.float64).tiny)
    return float(np.abs(np.subtract(now["numbers"], kept["numbers"])).max() / size)


def golden(kept: Path | None, new: Path | None) -> Iterator[Table]:
    """Write a file, or compare with one."""
    if new is not None:
        write(new)
    if kept is None:
        return
    where, items = read(kept)
    rows = [[each.name, each.what, f"{each.error:.1e}", verdict(each.agrees)] for each in differing(kept, list(items))]
    yield Table(
        f"What differs from {kept.name}: {len(rows)} of {len(items)}",
        ("item", "what", "differs by", "met"),
        rows,
        (
            f"Written on {where}; this is {machine()}. The difference is in units of what may differ between "
            f"processors: {VALUES:g} tolerances of values, {GRADIENTS:g} of gradients, {ITERATES:g} of iterates.",
        ),
    )
