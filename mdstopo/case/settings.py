"""Solver and optimizer settings: which options go together, and which the chosen method ignores."""

from __future__ import annotations

from typing import Any

from mdstopo.case.arrays import FrozenDict
from mdstopo.case.loading import Window
from mdstopo.case.model import OptimizerSettings, SolverSettings
from mdstopo.case.reading import BAD, Fields, Reading
from mdstopo.case.words import count_text, inside, number_text
from mdstopo.optimizer.options import OPTIONS

MOST_STEPS = 10**8
"""Fixed steps in one load case; more would neither end nor fit in memory."""


def build_solver(fields: Any, times: dict[str, Window], reading: Reading) -> SolverSettings:
    """The solver's settings; the defaults where they could not be read."""
    if fields is None or fields is BAD:
        return SolverSettings()
    integrator, sensitivity = fields["integrator"], fields["sensitivity"]
    step, tolerance = fields["step"], fields["tolerance"]
    if sensitivity == "iterative" and integrator in ("gauss", "runge_kutta"):
        reading.mistake(
            inside(fields.path, "sensitivity"),
            f"iterative does not go with the integrator {integrator}: it needs generalized_alpha (or auto)",
        )
    longest = max((window.end - window.start for window in times.values() if window.good), default=0.0)
    if step is not None and step is not BAD and longest / step > MOST_STEPS:
        reading.mistake(
            inside(fields.path, "step"),
            f"found {number_text(step)}: {count_text(int(min(longest / step, 1e300)))} steps in "
            f"{number_text(longest)} s; allowed are {count_text(MOST_STEPS)}",
        )
    if not fields.good():
        return SolverSettings()
    _warn_ignored(fields, reading)
    return SolverSettings(
        integrator, tolerance, sensitivity, fields["assemble"], step, fields["spectral_radius"], fields["settle"]
    )


def _warn_ignored(fields: Fields, reading: Reading) -> None:
    integrator = fields["integrator"]
    damped = integrator == "generalized_alpha" or (integrator == "auto" and fields["sensitivity"] == "iterative")
    if "spectral_radius" in fields.stated and not damped:
        message = f"the integrator {integrator} ignores spectral_radius: only generalized_alpha has one"
        reading.warning(inside(fields.path, "spectral_radius"), message)
    if "step" in fields.stated and "tolerance" in fields.stated:
        reading.warning(inside(fields.path, "tolerance"), "ignored: `step` fixes the steps")


def warn_assemble(top: Fields, reading: Reading) -> None:
    """`assemble` without anything to assemble."""
    solver = top["solver"]
    if not isinstance(solver, Fields) or solver["assemble"] is not True:
        return
    cases = top["load_cases"] if isinstance(top["load_cases"], dict) else {}
    moved = top["motions"] or any(isinstance(case, Fields) and case["motions"] for case in cases.values())
    if not top["joints"] and not moved:
        reading.warning(inside(solver.path, "assemble"), "ignored: there are no joints and no motions")


def build_optimizer(fields: Any) -> OptimizerSettings:
    """The optimizer's settings; the defaults where they could not be read."""
    if fields is None or fields is BAD or not fields.good():
        return OptimizerSettings()
    options = FrozenDict({name: fields[name] for name in OPTIONS if name in fields.stated})
    return OptimizerSettings(
        fields["name"],
        fields["preset"],
        fields["max_iterations"],
        fields["tolerance"],
        fields["starts"],
        fields["seed"],
        options,
    )
