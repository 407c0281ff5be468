"""Objective and exact gradient: error against time, in ms and in force passes."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from statistics import median

from benchmarks.force_pass import force_pass
from benchmarks.reference import ADAPTIVE, agreement, reference
from benchmarks.scenes import DESIGNS, SCENES, design, scene
from mdstopo import evaluate
from mdstopo.bench.reference import solution
from mdstopo.bench.tables import Table, spread, verdict
from mdstopo.bench.timing import interleaved

LEVELS = (1e-6, 1e-8, 1e-10)
TOLERANCES = (1e-3, 2e-4, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)

#: most that an evaluation may take that has to find a peak, in times of the same motion looked at when it is over
FINDING = 1.5

COLUMNS = (
    "scene, design",
    "error at most",
    "integrator",
    "tolerance",
    "error of G",
    "error of the gradient",
    "ms",
    "force passes",
)


@dataclass(frozen=True)
class Setting:
    """One way to evaluate one design of one scene."""

    scene: str
    design: str
    integrator: str
    tolerance: float


@dataclass(frozen=True)
class Measured:
    """errors: of G and of the gradient, relative; call: evaluates once."""

    errors: tuple[float, float]
    call: Callable[[], object]


def speed() -> Iterator[Table]:
    """Two tables: the first is timed in one interleaved run, each row of the second in its own."""
    measured = dict(_settings())
    unit_call, passes = force_pass(scene("fig6"))
    calls: dict[Setting | None, Callable[[], object]] = {None: unit_call}
    times = interleaved(calls | {setting: each.call for setting, each in measured.items()}, seconds=0.02)
    unit = [seconds / passes for seconds in times[None]]
    rows = []
    for name in SCENES:
        for design_name in DESIGNS:
            for level in LEVELS:
                for integrator in ADAPTIVE:
                    good = [
                        setting
                        for setting, each in measured.items()
                        if (setting.scene, setting.design, setting.integrator) == (name, design_name, integrator)
                        and each.errors[1] <= level
                    ]
                    head = [f"{name}, {design_name}", f"{level:.0e}", integrator]
                    if not good:
                        rows.append([*head, "none", "", "", "", ""])
                        continue
                    best = min(good, key=lambda setting: median(times[setting]))
                    rows.append(
                        [
                            *head,
                            f"{best.tolerance:.0e}",
                            *(f"{error:.1e}" for error in measured[best].errors),
                            spread([1e3 * seconds for seconds in times[best]]),
                            f"{median(times[best]) / median(unit):.0f}",
                        ]
                    )
    agreements = ", ".join(f"{agreement(s, d):.1e} ({s}, {d})" for s in SCENES for d in DESIGNS)
    yield Table(
        "Objective and exact gradient, 1020 members",
        COLUMNS,
        rows,
        (
            f"A force pass takes {spread([1e6 * seconds for seconds in unit])} microseconds here.",
            "Times are medians (least - most) over interleaved rounds of whole `mdstopo.evaluate` calls, after "
            "compilation; each row is the fastest tolerance whose measured error is at most the level.",
            "Errors are relative to the other adaptive integrator's result at tolerance 1e-13; with both at that "
            f"tolerance the gradients differ by {agreements}.",
        ),
    )
    yield _finding()


def _finding() -> Table:
    """What it costs to find a peak inside the interval, beside the energy when the same motion is over."""
    rows = []
    for name in DESIGNS:
        for tolerance in (1e-3, 1e-5, 1e-7):
            calls = {}
            for each in ("interior", "interior_end"):
                case = scene(each, integrator="gauss", tolerance=tolerance)
                calls[each] = partial(evaluate, case, design(name, case.n_design))
            times = interleaved(calls, seconds=0.02)
            found, at_end = (1e3 * median(times[each]) for each in calls)
            ratio = median(a / b for a, b in zip(*times.values(), strict=True))
            rows.append(
                [name, f"{tolerance:.0e}", f"{found:.4f}", f"{at_end:.4f}", f"{ratio:.2f}", verdict(ratio <= FINDING)]
            )
    return Table(
        "A peak inside the interval, found in continuous time",
        ("design", "tolerance", "ms, peak found", "ms, looked at the end", "ratio", f"at most {FINDING:g}"),
        rows,
        ("Objective and exact gradient of the interior scene, and of the same looked at when time is over.",),
    )


def _settings() -> Iterator[tuple[Setting, Measured]]:
    for name in SCENES:
        for design_name in DESIGNS:
            for integrator in ADAPTIVE:
                truth = reference(name, design_name, integrator)
                for tolerance in TOLERANCES:
                    case = scene(name, integrator=integrator, tolerance=tolerance)
                    alpha = design(design_name, case.n_design)
                    yield (
                        Setting(name, design_name, integrator, tolerance),
                        Measured(truth.errors(*solution(case, alpha)), partial(evaluate, case, alpha)),
                    )
