"""CasADi with SUNDIALS and its adjoint: CVODES with the multipliers eliminated, or IDAS with them as unknowns."""

from typing import Any

import casadi as ca
import numpy as np

from benchmarks.peers.casadi_model import Model, model_of
from benchmarks.peers.peak import highest
from benchmarks.peers.problem import Floats, Problem
from benchmarks.peers.table import Objective

#: times at which a run is looked at to find its peak; corrections of the peak's time
LOOKS, CORRECTIONS = 20, 2
#: what the generated C is compiled with; at a higher level scenes of this size take gcc many minutes more
FLAGS = ["-O1", "-march=native"]


def make(problem: Problem, tolerance: float = 1e-8, method: str = "cvodes", compiled: bool = False) -> Objective:
    """As the table says. method: cvodes or idas. compiled: by a C compiler, which takes minutes."""
    start = np.concatenate([problem.start.ravel(), np.zeros(3 * problem.bodies)])
    return objective_of(problem, model_of(problem), start, tolerance, method, compiled)


def objective_of(
    problem: Problem, model: Model, start: Floats, tolerance: float, method: str, compiled: bool
) -> Objective:
    """The benchmark's objective of any equations of motion.

    problem: of it the number of members, the end and whether a peak is wanted are used.
    model: its expressions. start: the state at the start. tolerance, method, compiled: as of `make`.
    """
    # time runs to 1, and the end is a parameter, so that a run to another time needs no other integrator
    end, alpha = ca.SX.sym("end"), model.alpha
    options = options_of(tolerance, method, compiled)
    if method == "cvodes":
        equations = {"x": model.y, "p": ca.vertcat(alpha, end), "ode": end * model.rate}
    else:
        equations = {"x": model.y, "p": ca.vertcat(alpha, end), "ode": end * model.free}
        equations |= {"z": model.z, "alg": model.misfit}
    design, time = ca.MX.sym("design", problem.members), ca.MX.sym("time")
    given = {"x0": start, "p": ca.vertcat(design, time)}
    last = ca.integrator("last", method, equations, 0, 1, options)(**given)["xf"]
    value = ca.Function("energy", [model.y, alpha], [model.energy])(last, design)
    both = ca.Function("both", [design, time], [value, ca.gradient(value, design)])
    alone = ca.Function("alone", [design, time], [value, last])
    peak = None
    if problem.peak:
        grid = np.arange(1, LOOKS + 1) / LOOKS
        states = ca.integrator("states", method, equations, 0, grid, options)(**given)["xf"]
        whole = ca.Function("whole", [design, time], [ca.horzcat(start, states)])
        peak = _Peak(model, whole, alone, problem.end)

    def objective(design: Floats, gradient: bool) -> tuple[float, Floats | None]:
        time = problem.end if peak is None else peak(design)
        if not gradient:
            return float(alone(design, time)[0]), None
        found, slopes = both(design, time)
        return float(found), np.asarray(slopes).ravel()

    return objective


def options_of(tolerance: float, method: str, compiled: bool) -> dict[str, Any]:
    """Options of CasADi's integrators."""
    options: dict[str, Any] = {
        "reltol": tolerance,
        "abstol": 1e-2 * tolerance,
        "max_num_steps": 100_000,
        "steps_per_checkpoint": 500,
        "interpolation_type": "hermite",
    }
    if method == "cvodes":
        # nothing here is stiff: Adams' formulas, no matrices
        options |= {"linear_multistep_method": "adams", "nonlinear_solver_iteration": "functional"}
    if compiled:
        options |= {"jit": True, "compiler": "shell", "jit_options": {"flags": FLAGS, "verbose": False}}
        options["jit_temp_suffix"] = True
    return options


class _Peak:
    """The time of the highest energy: looks at the motion, then Newton's method with runs to the time itself."""

    def __init__(self, model: Model, whole: Any, alone: Any, end: float) -> None:
        turning = ca.jtimes(model.power, model.y, model.rate)
        self._look = ca.Function("look", [model.y, model.alpha], [model.energy, model.power]).map(LOOKS + 1)
        self._slope = ca.Function("slope", [model.y, model.alpha], [model.power, turning])
        self._whole, self._alone, self._end = whole, alone, end

    def __call__(self, design: Floats) -> float:
        states = self._whole(design, self._end)
        heights, slopes = self._look(states, np.tile(design[:, None], LOOKS + 1))
        time, inside = highest(np.asarray(heights).ravel(), np.asarray(slopes).ravel(), self._end)
        for _ in range(CORRECTIONS if inside else 0):
            power, turning = self._slope(self._alone(design, time)[1], design)
            time -= float(power) / float(turning)
        return time
