"""Designs at their edge: alpha exactly 0 with any power, tied peaks, objectives that are zero throughout."""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mdstopo.api import optimize
from mdstopo.stress.measuring import ADAPTIVE, ENERGY, ball, differentiated, error, moved, spring, valued
from mdstopo.stress.scene import Refused, Scene

if TYPE_CHECKING:
    from mdstopo.case.model import Case

PULL = 30.0


def parallel(power: float, alpha: float, lower: float = 0.0, **solver: Any) -> dict[str, Any]:
    """Two groups in parallel between ground and a pulled body; the second group begins at `alpha`."""
    return {
        "time": {"end": 1.3},
        "bodies": {"ball": ball(1.0)},
        "members": {
            "kept": spring([0.0, 0.0], "ball", [1.0, 0.0], stiffness=100.0),
            "gone": spring([-1.0, 0.0], "ball", [1.0, 0.0], stiffness=50.0),
        },
        "loads": [{"body": "ball", "force": [PULL, 0.0]}],
        "design": {"initial": {"kept": 1.0, "gone": alpha}, "lower": lower, "power": {"kept": 1.0, "gone": power}},
        "objectives": {"G": {**ENERGY["G"], "over_time": "max"}},
        "constraints": [{"volume": "all", "limit": 1.5}],
        "solver": solver,
    }


def _parallel(power: float, case: "Case") -> float:
    """G = 2 F^2 / k at half a period, its slope by alpha^mu."""
    found = valued(case)
    kept, gone = case.initial
    k = 100.0 * kept + 50.0 * gone**power
    slope = -2.0 * PULL**2 / k**2
    by_gone = 50.0 * power * (gone ** (power - 1.0) if power != 1.0 else 1.0)
    return max(
        error(found.objectives["G"], 2.0 * PULL**2 / k), error(found.gradients["G"], [100.0 * slope, by_gone * slope])
    )


def _optimized(case: "Case") -> float:
    """The optimum spends nothing on what is dearer: all kept at 1, the rest of the volume on what is gone."""
    result = optimize(case)
    if result.status not in ("converged", "max_iterations", "stalled"):
        raise Refused(f"{result.status}: {result.reason}")
    return error(result.alpha, [1.0, 0.5]) if np.all(np.isfinite(result.alpha)) else float("nan")


def tied(count: int, **solver: Any) -> dict[str, Any]:
    """A swing that reaches the same peak `count` times."""
    scene = parallel(1.0, 1.0, **solver)
    scene["members"].pop("gone")
    scene["time"] = {"end": 2.0 * np.pi / 10.0 * count}
    scene["design"] = {"initial": 1.0}
    scene.pop("constraints")
    return scene


def _tied(count: int, case: "Case") -> float:
    """Value and gradient of each peak that is given, the first of them the earliest."""
    found = valued(case)
    value = 2.0 * PULL**2 / 100.0
    worst = max(error(found.objectives["G"], value), error(found.gradients["G"], [-value]))
    for peak in found.peaks["G"]:
        assert peak.gradient is not None
        # with the time held fixed the slope is the same: the rate is zero there
        worst = max(worst, error(peak.value, value), error(peak.gradient, [-value]))
    times = np.pi / 10.0 * (2.0 * np.arange(count) + 1.0)
    nearest = np.abs(times[:, None] - [peak.time for peak in found.peaks["G"]]).min(axis=0)
    return max(worst, float(nearest.max()))


def twins(**solver: Any) -> dict[str, Any]:
    """Two bodies that do the same on members of their own; the response is the largest force in a member."""
    return {
        "time": {"end": 0.5},
        "bodies": {"one": ball(1.0), "other": ball(1.0)},
        "points": {
            "wall": {"body": "ground", "grid": {"list": [[0.0, 0.0], [0.0, 0.1]]}},
            "feet": {"body": "one", "grid": {"list": [[1.0, 0.0], [1.0, 0.1]]}},
        },
        "members": {
            "ties": {
                "from": "wall", "to": "feet", "connect": "pairs", "law": {"type": "spring", "stiffness": 50.0}
            }
        },
        "loads": [{"body": "one", "force": [PULL, 0.0], "at": [1.0, 0.05]}],
        "motions": [{"body": "one", "y": {"velocity": 0.0}, "angle": {"velocity": 0.0}}],
        "design": {"initial": 1.0},
        "objectives": {"G": {"response": {"member_force": {"group": "ties"}}, "over_time": "max"}},
        "solver": solver,
    }  # fmt: skip


def _twins(case: "Case") -> float:
    """Both members carry F at the peak; d f_i / d alpha_j = F (delta_ij - 1/2) of the elongation 2 F / k."""
    found = valued(case)
    worst = error(found.objectives["G"], PULL)
    rows = np.array([peak.gradient for peak in found.peaks["G"]])
    if rows.shape != (2, 2):
        return 1.0
    rows = rows[np.argsort(-rows[:, 0])]

    def force(which: int, alpha: Any) -> Any:
        k = 50.0 * (alpha[0] + alpha[1])
        return 50.0 * alpha[which] * 2.0 * PULL / k

    expected = np.array([differentiated(partial(force, i), np.ones(2))[1] for i in range(2)])
    return max(worst, error(rows, expected))


def idle(**more: Any) -> dict[str, Any]:
    """A scene in which no member is strained: the stored energy is zero throughout."""
    solver = more.pop("solver", {})
    scene = parallel(1.0, 0.5, 0.01, **solver)
    scene.pop("loads")
    return scene | more


def _nothing(case: "Case") -> float:
    found = valued(case)
    return max(abs(found.objectives["G"]), float(np.abs(found.gradients["G"]).max()))


def _nothing_to_optimize(case: "Case") -> float:
    """Whatever the design, nothing is stored: the start is as good as any."""
    result = optimize(case)
    if result.status not in ("converged", "max_iterations", "stalled"):
        raise Refused(f"{result.status}: {result.reason}")
    return max(abs(result.objectives[name]) if name == "G" else 0.0 for name in result.objectives)


def beside_something(method: str, normalize: bool = True) -> dict[str, Any]:
    """Two load cases: in one of them nothing pulls."""
    pull = parallel(1.0, 0.5, 0.01)
    loads = pull.pop("loads")
    combine: dict[str, Any] = {"method": method, "weights": {"G": 1, "H": 1}}
    if method != "weighted_product":
        combine["normalize"] = normalize
    return pull | {
        "load_cases": {"rest": {}, "pulled": {"loads": loads}},
        "objectives": {"G": {**ENERGY["G"], "load_case": "rest"}, "H": {**ENERGY["G"], "load_case": "pulled"}},
        "combine": combine,
    }


def _beside_something(case: "Case") -> float:
    """The other objective decides: all of `kept`, the rest of the volume on `gone`."""
    result = optimize(case)
    if result.status not in ("converged", "max_iterations", "stalled"):
        raise Refused(f"{result.status}: {result.reason}")
    return max(abs(result.objectives["G"]), error(result.objectives["H"], 2.0 * PULL**2 / 125.0))


def _zero_response(case: "Case") -> float:
    """Every response of a body at rest, which has no direction, and no slope to be seen in its norm."""
    motion = moved(case)
    found = valued(case)
    worst = float(np.abs(motion.v).max())
    for name, value in found.objectives.items():
        worst = max(worst, abs(value), float(np.abs(found.gradients[name]).max()))
    return worst


def resting(**solver: Any) -> dict[str, Any]:
    """A body at rest, with every way to reduce a response."""
    of = {"body": "ball"}
    objectives: dict[str, Any] = {
        name: {"response": {name: of}, "over_time": over}
        for name, over in (("displacement", "max"), ("velocity", "rms"), ("acceleration", "max"), ("angle", "max_abs"))
    }
    objectives["force"] = {"response": {"member_force": {"group": "kept"}}, "over_time": "max"}
    return idle(objectives=objectives, combine={"weights": dict.fromkeys(objectives, 1)}, solver=solver)


def scenes() -> list[Scene]:
    """Evaluations, and optimisations where those could go wrong."""
    found = []
    for integrator in (*ADAPTIVE, "generalized_alpha"):
        tag = integrator.replace("_", "-")
        tolerance = 1e-4 if integrator == "generalized_alpha" else 1e-9
        solver: dict[str, Any] = {"integrator": integrator, "tolerance": tolerance}
        bound = 10.0 * tolerance
        found += [
            Scene(
                f"zero-alpha-power-{power:g}-{tag}",
                f"alpha = 0 with the power {power:g}: energy and gradient in closed form",
                parallel(power, 0.0, **solver),
                partial(_parallel, power),
                bound=bound,
            )
            for power in (1.0, 1.5, 3.0)
        ]
        found += [
            Scene(
                f"ties-{count}-{tag}",
                f"{count} equal peaks of a swing: value, time and gradient of each that is given",
                tied(count, **solver),
                partial(_tied, count),
                bound=bound,
            )
            for count in (2, 40)
        ]
        found.append(
            Scene(
                f"zero-objective-{tag}",
                "a stored energy that is zero throughout: zero and without slope",
                idle(solver=solver),
                _nothing,
                bound=1e-300,
            )
        )

    found += [
        Scene(
            "zero-alpha-power-0.5-in-the-case",
            "alpha = 0 allowed with a power below 1, where there is no slope",
            parallel(0.5, 0.0),
            partial(_parallel, 0.5),
            refusal=("design", "> 0 where power is below 1"),
        ),
        Scene(
            "zero-alpha-power-0.5",
            "a gradient asked for at alpha = 0 with a power below 1",
            parallel(0.5, 0.5, 0.01),
            _without_slope,
            refusal=("no gradient", "group gone", "power 0.5"),
        ),
        Scene(
            "zero-alpha-optimized",
            "an optimisation that begins at alpha = 0 with the power 3, where the slope is zero",
            parallel(1.0, 0.0),
            _optimized,
            bound=1e-4,
        ),
        Scene(
            "ties-members",
            "two members whose forces are equal throughout: the gradient of each",
            twins(tolerance=1e-9),
            _twins,
            bound=1e-7,
        ),
        Scene(
            "zero-objective-optimized",
            "an objective that is zero for every design, optimised",
            idle(),
            _nothing_to_optimize,
            bound=1e-300,
        ),
        Scene(
            "zero-objective-responses",
            "displacement, velocity, acceleration, angle and force of a body at rest: zero and without slope",
            resting(),
            _zero_response,
            bound=1e-300,
        ),
        Scene(
            "zero-objective-beside-product",
            "a weighted product with an objective that is zero throughout",
            beside_something("weighted_product"),
            _beside_something,
            refusal=("objective G", "weighted_product"),
        ),
    ]
    found += [
        Scene(
            f"zero-objective-beside-{method.removeprefix('weighted_').replace('_', '-')}",
            f"{method} with an objective that is zero throughout: the other one decides",
            beside_something(method),
            _beside_something,
            bound=1e-3,
        )
        for method in ("weighted_exponential", "weighted_sum", "weighted_min_max")
    ]
    return found


def _without_slope(case: "Case") -> float:
    found = valued(case, [1.0, 0.0])
    return error(found.gradients["G"], [0.0, 0.0])
