"""The applications: what `mdstopo run` finds, whether it holds, and what a careful hand would have done."""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.forces import Motion, strokes, whole_forces
from benchmarks.hand import HANDS, alike, even, places, sized
from benchmarks.scenes import CASES
from mdstopo import Case, Evaluation, evaluate, load_case, optimize, simulate
from mdstopo.bench.tables import Table, significant, verdict
from mdstopo.case.model import ReducedResponse, VolumeRow
from mdstopo.case.objects.parts import MemberGroup
from mdstopo.case.responses.response_units import words
from mdstopo.optimizer.scalarisation import Scalarisation

Floats = NDArray[np.float64]

APPLICATIONS = ("restraint", "tiedown", "mooring", "lander", "touchdown", "cargo", "occupant")
#: what the constraints are held to, relative to their bounds, how much finer they are computed, seconds allowed in the
#: plane and in space
HELD, FINER, SECONDS = 1e-6, 100.0, {2: 120.0, 3: 180.0}
#: size from which a member is listed; tables of each application
PRESENT, TABLES = 0.02, 4


def applications(names: Sequence[str] | None = None, folder: Path | None = None) -> Iterator[Table]:
    """Four tables for each of these applications (None: all). folder: where the designs found, and by hand, are written
    as text."""
    for name in names or APPLICATIONS:
        case = load_case(CASES / f"{name}.yaml")
        began = time.process_time()
        result = optimize(case)
        seconds, allowed = time.process_time() - began, SECONDS[case.dimension]
        fine = finer(case)
        found, first = evaluate(fine, result.alpha, gradient=False), evaluate(fine, gradient=False)
        score = scorer(case)
        drawn = sized(case, places(case, HANDS[name]), combined(case))
        if folder is not None:
            np.savetxt(folder / f"{name}.txt", result.alpha, fmt="%.17g")
            np.savetxt(folder / f"{name}-hand.txt", drawn, fmt="%.17g")
        hand = evaluate(fine, drawn, gradient=False)
        same = evaluate(fine, sized(case, even(case), combined(case)), gradient=False)
        yield values(case, {"start": first, "even": same, "hand": hand, "found": found})
        yield members(case, {"hand": drawn, "found": result.alpha})
        yield Table(
            f"{case.title}: the run",
            ("", "found", "hand", "even", "start", "bar", "met"),
            [
                ["variables, evaluations", f"{case.space.size}, {result.evaluations}", "", "", "", "", ""],
                ["ended", str(result.status).replace("_", " "), "", "", "", "", ""],
                ["seconds", significant(seconds), "", "", "", f"under {allowed:g}", verdict(seconds < allowed)],
                [
                    "largest excess over a bound",
                    *(f"{excess(case, each):.1e}" for each in (found, hand, same, first)),
                    f"at most {HELD:g}, hand's too", verdict(max(excess(case, found), excess(case, hand)) <= HELD),
                ],
                [
                    "combined objective", *(significant(score(each), 4) for each in (found, hand, same, first)),
                    "below hand's", verdict(score(found) < score(hand)),
                ],
            ],
            (
                "Seconds are of one processor, kernels compiled. Excesses are relative to the bounds and computed with "
                "a hundredth of the case's tolerance, 0 where all limits hold.",
            ),
        )  # fmt: skip
        yield carried(case, result.alpha)


def finer(case: Case) -> Case:
    """The case, computed to a hundredth of its tolerance."""
    return replace(case, solver=replace(case.solver, tolerance=case.solver.tolerance / FINER))


def combined(case: Case) -> Scalarisation:
    """U of a case that needs no utopia for it."""
    assert case.combine is not None
    assert case.combine.method == "weighted_product" or not case.combine.normalize
    return Scalarisation(case.combine.method, np.array([case.combine.weights[each.name] for each in case.objectives]))


def scorer(case: Case) -> Callable[[Evaluation], float]:
    """U of an evaluation."""
    u = combined(case)

    def score(found: Evaluation) -> float:
        return float(u.values(np.array([[found.objectives[each.name] for each in case.objectives]]))[0])

    return score


def excess(case: Case, found: Evaluation) -> float:
    """The largest excess over a bound, relative to it; 0 where all constraints hold, NaN where one is unknown."""
    over = [
        {"limit": value, "at_least": -value, "equals": abs(value)}[row.sense] / (abs(row.bound) or 1.0)
        for row, value in zip(case.constraints, found.constraints.tolist(), strict=True)
    ]
    return float(np.max([0.0, *over]))


def values(case: Case, designs: dict[str, Evaluation]) -> Table:
    """Objectives and constraints of designs, side by side."""
    rows = []
    for objective in case.objectives:
        label = f"{objective.name}: {described(objective)}"
        rows.append([label, "", *(significant(found.objectives[objective.name], 4) for found in designs.values())])
    for i, row in enumerate(case.constraints):
        sense = {"limit": "at most", "at_least": "at least", "equals": "exactly"}[row.sense]
        label = volume_of(case, row) if isinstance(row, VolumeRow) else described(row)
        cells = [significant(found.constraints[i] + row.bound, 4) for found in designs.values()]
        rows.append([label, f"{sense} {row.bound:g}", *cells])
    return Table(f"{case.title}: what is reached", ("", "bound", *designs), rows)


def volume_of(case: Case, row: VolumeRow) -> str:
    """Which groups a volume row adds up."""
    whole = len(row.groups) > 1 and len(row.groups) == len(case.design_groups)
    return "volume of all" if whole else f"volume of {', '.join(row.groups)}"


def described(looked: ReducedResponse) -> str:
    """What is looked at, in words."""
    return f"{looked.over_time} {words(looked.response)}, {looked.load_case}"


def members(case: Case, designs: dict[str, Floats]) -> Table:
    """The members that any of the designs has; of groups whose members are alike the first."""
    rows, notes = [], []
    for groups in alike(case):
        group, at = groups[0], case.group_slices[groups[0].name].start
        for k in range(len(group)):
            sizes = [float(alpha[at + k]) for alpha in designs.values()]
            if max(sizes) >= PRESENT:
                p, q = group.from_world[group.from_index[k]], group.to_world[group.to_index[k]]
                ends = [f"({', '.join(f'{x:g}' for x in end)})" for end in np.round((p, q), 3).tolist()]
                rows.append([group.name, *ends, *(f"{size:.3f}" if size >= PRESENT else "" for size in sizes)])
        if len(groups) > 1:
            notes.append(f"The same in {', '.join(each.name for each in groups[1:])}.")
    title = f"{case.title}: members of size {PRESENT} and more"
    return Table(title, ("group", "from, m", "to, m", *designs), rows, notes)


def carried(case: Case, alpha: Floats) -> Table:
    """What present members carry: the largest force of each group, that of the most strained one if it were whole,
    and the largest stroke; of groups whose members are alike the largest of all."""
    rows = []
    motions = {each.name: simulate(case, alpha, each.name) for each in case.load_cases}
    for groups in alike(case):
        if (alpha[case.group_slices[groups[0].name]] >= PRESENT).any():
            for load_case in case.load_cases:
                motion = motions[load_case.name]
                each = np.array([_carried(case, alpha, group, load_case.name, motion) for group in groups])
                rows.append([groups[0].name, load_case.name, *(significant(float(most)) for most in each.max(axis=0))])
    return Table(
        f"{case.title}: forces",
        ("group", "load case", "largest, N", "of a whole member, N", "stroke, m"),
        rows,
        ("Written out a second time (`benchmarks/forces.py`). *Of a whole member* is what the most strained member "
         "would carry at size 1: what its strength has to be compared with. The stroke is by how much the length of "
         "any of them changes at most.",),
    )  # fmt: skip


def _carried(case: Case, alpha: Floats, group: MemberGroup, load_case: str, motion: Motion) -> tuple[float, ...]:
    """Of a group's present members: the largest force, that of a whole member, the largest stroke."""
    own = alpha[case.group_slices[group.name]]
    there = own >= PRESENT
    whole = whole_forces(case, alpha, group, load_case, motion)[there]
    far = strokes(case, alpha, group, load_case, motion)[there]
    return float((whole * own[there]).max()), float(whole.max()), float(far.max())
