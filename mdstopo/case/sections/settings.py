"""Solver and optimizer settings: which options go together, and which the chosen method ignores."""

from __future__ import annotations

import math
from typing import Any

from mdstopo.case.arrays import FrozenDict
from mdstopo.case.methods.integrators import AUTO, INTEGRATORS, having
from mdstopo.case.methods.sensitivities import chosen
from mdstopo.case.model import OptimizerSettings, SolverSettings
from mdstopo.case.scene.load_case_times import TimeSpan
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import count_text, inside, listed, number_text
from mdstopo.settings.optimizer_options import OPTIONS
from mdstopo.settings.optimizers import OPTIMIZERS

MOST_STEPS = 10**8
"""Fixed steps in one load case; more would neither end nor fit in memory."""
FEWEST_STEPS = 16
"""Steps of generalized_alpha in a load case below which there is a warning: they hardly tell the motion."""
ROUNDING = 1e-9
"""Share of a length of time that does not count: 0.3 / 3 is as good as 0.1."""


def build_solver(fields: Any, times: dict[str, TimeSpan], reading: Reading) -> SolverSettings:
    """The solver's settings; the defaults where they could not be read."""
    if fields is None or fields is BAD:
        return SolverSettings()
    integrator, sensitivity = fields["integrator"], fields["sensitivity"]
    step, tolerance = fields["step"], fields["tolerance"]
    needed = _steps_needed(fields)
    if needed and integrator in INTEGRATORS and not getattr(INTEGRATORS[integrator], needed):
        reading.mistake(
            inside(fields.path, "sensitivity"),
            f"{sensitivity} does not go with the integrator {integrator}: it needs {listed(having(needed))} (or auto)",
        )
    if step is not None and step is not BAD:
        _check_step(fields, [span.end - span.start for span in times.values() if span.good], reading)
    if not fields.good():
        return SolverSettings()
    _warn_ignored(fields, reading)
    return SolverSettings(
        integrator, tolerance, sensitivity, fields["assemble"], step, fields["spectral_radius"], fields["settle"]
    )


def _check_step(fields: Fields, spans: list[float], reading: Reading) -> None:
    """Refuse a fixed step that no load case of such a length (s) can be computed with; warn of one that is coarse."""
    step, path = fields["step"], inside(fields.path, "step")
    longest, shortest = max(spans, default=0.0), min(spans, default=step)
    if longest / step > MOST_STEPS:
        reading.mistake(
            path,
            f"found {number_text(step)}: {count_text(int(min(longest / step, 1e300)))} steps in "
            f"{number_text(longest)} s; allowed are {count_text(MOST_STEPS)}",
        )
    elif step > shortest * (1.0 + ROUNDING):
        whose = "the motion" if longest == shortest else "the shortest load case"
        reading.mistake(
            path,
            f"found {number_text(step)}: longer than {whose}, which takes {number_text(shortest)} s; allowed is less",
        )
    elif _has_spectral_radius(fields) and shortest < FEWEST_STEPS * step * (1.0 - ROUNDING):
        count = math.ceil(shortest / step * (1.0 - ROUNDING))
        words = "one step" if count == 1 else f"{count} steps"
        reading.warning(
            path,
            f"{words} of generalized_alpha for {number_text(shortest)} s: what comes out may have little to do with "
            "the motion; halve the step until nothing changes, or leave it out",
        )


def _steps_needed(fields: Fields) -> str:
    """The capability that the method of differentiation needs of the integrator, or nothing."""
    sensitivity = fields["sensitivity"]
    return "" if sensitivity is BAD else chosen(sensitivity).steps


def _has_spectral_radius(fields: Fields) -> bool:
    """Whether the integrator is one with a spectral radius."""
    integrator: str = fields["integrator"]
    if integrator == AUTO:
        return bool(_steps_needed(fields))
    return integrator in INTEGRATORS and INTEGRATORS[integrator].has_radius


def _warn_ignored(fields: Fields, reading: Reading) -> None:
    integrator = fields["integrator"]
    if "spectral_radius" in fields.stated and not _has_spectral_radius(fields):
        message = f"the integrator {integrator} ignores spectral_radius: only generalized_alpha has one"
        reading.warning(inside(fields.path, "spectral_radius"), message)
    if "step" in fields.stated and "tolerance" in fields.stated:
        reading.warning(inside(fields.path, "tolerance"), "ignored: `step` fixes the steps")


def warn_assemble(top: Fields, reading: Reading) -> None:
    """Warn where `assemble` is set and the case has nothing to assemble."""
    solver = top["solver"]
    if not isinstance(solver, Fields) or solver["assemble"] is not True:
        return
    cases = top["load_cases"] if isinstance(top["load_cases"], dict) else {}
    moved = top["motions"] or any(isinstance(case, Fields) and case["motions"] for case in cases.values())
    if not top["joints"] and not moved:
        reading.warning(inside(solver.path, "assemble"), "ignored: there are no joints and no motions")


def build_optimizer(fields: Any, reading: Reading) -> OptimizerSettings:
    """The optimizer's settings; the defaults where they could not be read."""
    if fields is None or fields is BAD or not fields.good():
        return OptimizerSettings()
    kind = OPTIMIZERS[fields["name"]]
    for name in OPTIONS:
        if name in fields.stated and name not in kind.options:
            reading.mistake(inside(fields.path, name), f"{kind.name} has no such setting")
    if fields["preset"] not in kind.presets:
        reading.mistake(inside(fields.path, "preset"), f"{kind.name} has {listed(sorted(kind.presets))}")
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
