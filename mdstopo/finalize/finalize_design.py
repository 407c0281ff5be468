"""From a result to its final case, each step a verb: keep, size, verify, write, read again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from mdstopo.case.arrays import FloatArray, IndexArray
from mdstopo.case.design.movable import with_points_fixed
from mdstopo.case.model import Case
from mdstopo.case.reader import read_case
from mdstopo.case.text.errors import CaseError
from mdstopo.case.text.yaml_text import text_of
from mdstopo.evaluators import make_engine
from mdstopo.finalize.apart import apart, unlike
from mdstopo.finalize.document import content_of, final_content
from mdstopo.finalize.equilibria import Comparison, compare_equilibria
from mdstopo.finalize.keep import check, check_restricted, chosen, kept_values, one_alpha, places, restricted
from mdstopo.finalize.names import with_names_fixed
from mdstopo.finalize.parameter_values import Parameter, changed_parameters
from mdstopo.scene.refusals import refusals
from mdstopo.session.outcome import Outcome, Progress
from mdstopo.session.run_session import run_session
from mdstopo.starts.callbacks import ignore, never
from mdstopo.starts.evaluator_interface import Evaluation, equal_weights, problem_of
from mdstopo.starts.single_start import first_design, unshared
from mdstopo.status import RunStatus
from mdstopo.store.design_files import with_values
from mdstopo.store.result_reader import ResultView
from mdstopo.store.store_errors import StoreError
from mdstopo.store.stored_case import case_of

TIGHTER = 100.0
"""The verification's tolerance is the case's divided by this."""
SHORTER = 10.0
"""The verification's fixed step is the case's divided by this: errors of second order fall a hundredfold."""
TIGHTEST = 1e-13
"""The smallest tolerance of a verification: below it, rounding is larger than the errors that it asks for."""
WORSE = 0.05
"""An objective that is worse than the full design's by more than this share of it is warned of."""
TOLD_AS_FAR = 10.0
"""From this share on the warning says "far" and no percentage: the full design's objective is near zero."""


@dataclass(frozen=True)
class Column:
    """A column of the table that compares designs: its name, how many members it has, and its evaluation."""

    title: str
    members: int
    evaluation: Evaluation


@dataclass(frozen=True)
class Finalized:
    """A result whose members were kept, sized anew and verified, and the text of the final case.

    case: the full one; reduced: with only the members kept. kept (K,): their places among the design members, places:
    in their groups. before, alpha (K,): their alphas in the result and now; values: parameters of laws, before and now.
    outcome: of the re-optimisation. columns: full design, kept, re-optimised, verified; the last two are computed with
    the final case where the case has design variables beside alpha and the final case keeps all objectives and
    constraints; empty where the run was interrupted. tighter: the verification's tolerance or step in words. text: the
    final case, empty where there is none; told: sentences on what of the old case it leaves out. difference: the
    largest relative one between the objectives of the final case and those of the re-optimised design, None where it
    has no objectives. equilibria: where the final design settles, compared with the full one; where it does not rest at
    the full design's equilibrium there is no text. worse: sentences on objectives that are worse than the full
    design's.
    """

    case: Case
    reduced: Case
    kept: IndexArray
    places: list[tuple[str, int]]
    before: FloatArray
    alpha: FloatArray
    values: list[Parameter]
    outcome: Outcome
    columns: tuple[Column, ...] = ()
    tighter: str = ""
    text: str = ""
    told: list[str] = field(default_factory=list)
    difference: float | None = None
    equilibria: Comparison = field(default_factory=Comparison)
    worse: tuple[str, ...] = ()

    @property
    def written(self) -> int:
        """How many members the text has: those without a size are left out of it."""
        return int(np.count_nonzero(self.alpha**self.reduced.power > 0.0)) if self.text else 0


def opened(
    view: ResultView, changes: Mapping[str, str], notify: Callable[[str], None] = ignore
) -> tuple[Case, FloatArray]:
    """The case of a run, with further keys set, and its best design (N + P,).

    Where the case has one alpha for several members (`shared`, `mirrored`) the design has their mean.

    Points and defined names that were design variables stay where the design has them, and are none any more. Raises
    CaseError and StoreError.
    """
    if view.kind != "run":
        raise StoreError(f"{view.path}: a result of `{view.kind}`; finalize takes one of `run`")
    case = case_of(view, changes)
    for name, digest in case.files.items():
        if view.texts.get(f"files/{name}", digest) != digest:
            raise StoreError(f"{view.path}: the file {name} is no longer the one that the run read")
    if "design/alpha" not in view.arrays:
        raise StoreError(f"{view.path}: the run has no design yet")
    alpha = np.squeeze(view.alpha) if view.alpha.ndim > 1 else view.alpha
    if alpha.shape != (case.n_design,):
        raise StoreError(
            f"{case.path or case.name}: the design has {alpha.size} values; "
            f"the case has {case.n_design} design variables"
        )
    space = case.space
    if unknown := [name for name in view.under("design/variables") if name not in space.parts]:
        raise StoreError(f"{view.path}: it holds values of the design variable {unknown[0]}; the case has none")
    design = case.whole(with_values(view, None, alpha, space.parts))
    if words := unshared(case, design):
        notify(words)
        design = np.concatenate([space.expand(space.reduce(design))[: case.n_design], design[case.n_design :]])
    return with_points_fixed(*with_names_fixed(case, design))


def ready(case: Case, design: FloatArray, keep: int | None, threshold: float | None) -> tuple[IndexArray, Case]:
    """The members to keep and the case with only these; everything that can be refused is refused here.

    design (N,) or (N + P,). Members that have one alpha together are all kept, or none of them. A case without design
    members keeps all of its members.
    Raises CaseError and StoreError.
    """
    check(case)
    if not case.is_optimizable:
        raise StoreError(f"{case.path or case.name}: the case has no objectives to size members for")
    whole = case.whole(design)
    if whole.shape != (case.space.length,):
        raise ValueError(f"design must have {case.n_design} or {case.space.length} values, not {design.size}")
    alpha = whole[: case.n_design]
    kept = chosen(alpha, keep, threshold, one_alpha(case))
    if not len(kept) and case.n_design:
        raise StoreError(f"no member has alpha of {threshold:g} or more; the largest is {alpha.max():.6g}")
    split = unlike(case, kept)
    reduced = restricted(apart(case, split), kept, whole)
    check_restricted(reduced, case, split)
    content_of(case)
    return kept, reduced


def tied(alpha: FloatArray, kept: IndexArray) -> int:
    """How many members that are left out have as large an alpha (N,) as the smallest that is kept."""
    least = alpha[kept].min(initial=np.inf)
    return int(np.count_nonzero(alpha >= least)) - len(kept)


def finalize(
    case: Case,
    design: FloatArray,
    kept: IndexArray,
    reduced: Case,
    *,
    place: Path,
    head: Callable[[int], str] = lambda _: "",
    on_iteration: Callable[[Progress], None] = ignore,
    stop_requested: Callable[[], bool] = never,
    notify: Callable[[str], None] = ignore,
) -> Finalized:
    """Re-optimise the members kept, verify them, and make the text of the final case.

    Their sizes and the parameters of laws that vary are optimised together.

    case: the one of the result.
    design (N,) or (N + P,): the design of the result.
    kept (n,): which of its members are kept, as `ready` gave them.
    reduced: the case with only these, as `ready` gave it.
    place: where the text is going to stand.
    head: its first lines, comments, by how many members it has.
    on_iteration: called after each iteration of the optimiser.
    stop_requested: asked after each iteration whether to stop.
    notify: is given sentences for the user.

    The text is empty where the run was interrupted, or its design cannot be computed, or does not rest at the
    equilibrium of the full one.
    """
    design = case.whole(design)
    joined = apart(case, unlike(case, kept))
    held = kept_values(joined, kept)
    count = len(kept)
    before = design[np.concatenate([kept, case.n_design + held])]
    outcome = run_session(
        reduced, initial=before, on_iteration=on_iteration, stop_requested=stop_requested, notify=notify
    )
    engine = make_engine(reduced)
    reached = np.concatenate([outcome.alpha, *outcome.variables.values()])
    now = reduced.space.expand(first_design(reduced, problem_of(engine, equal_weights(reduced)), reached)[1])
    own = places(case, kept)
    sized_again = Finalized(
        case=case,
        reduced=reduced,
        kept=kept,
        places=own,
        before=before[:count],
        alpha=now[:count],
        values=changed_parameters(case, held, before[count:], now[count:]),
        outcome=outcome,
    )
    if outcome.status is RunStatus.INTERRUPTED:
        return sized_again
    found = engine.evaluate(now, gradient=False)
    full = Column("full design", case.n_design, make_engine(case).evaluate(design, gradient=False))
    first = Column("kept as they were", count, engine.evaluate(before, gradient=False))
    told: list[str] = []
    text, difference = "", None
    source, sized = reduced, now
    sizes_are_left = not count or bool(np.any(now[:count] ** reduced.power > 0.0))
    if found.status.usable and (sizes_are_left or _has_variables_of_fixed_members(reduced)):
        content, told = final_content(content_of(case), reduced, own, now)
        text = head(int(np.count_nonzero(now[:count] ** reduced.power > 0.0))) + text_of(content)
        final = _read(text, place)
        difference = _difference(final, found)
        if reduced.variables and _says_all(final, reduced):
            # without variables other kernels may compute it: what is reported is what is written
            source, sized = final, final.start
            found = make_engine(final).evaluate(sized, gradient=False)
    tighter, words = _tighter(source)
    verified = make_engine(tighter).evaluate(sized, gradient=False)
    columns = (full, first, Column("re-optimised", count, found), Column("verified", count, verified))
    compared = replace(sized_again, columns=columns, tighter=words, worse=worse_than_promised(case, columns))
    if not (found.status.usable and verified.status.usable):
        return compared
    end = design.copy()  # the final design as one of the full case: members left out have no size
    end[: case.n_design] = 0.0
    end[kept], end[case.n_design + held] = now[:count], now[count:]
    equilibria = compare_equilibria(joined, design, end, reduced, now)
    compared = replace(compared, equilibria=equilibria)
    return compared if equilibria.lost else replace(compared, text=text, told=told, difference=difference)


def _has_variables_of_fixed_members(case: Case) -> bool:
    """Whether a variable is a parameter of members whose sizes are no design variables, which are always written."""
    fixed = {group.name for group in case.members if not group.design}
    return any(fixed & set(variable.groups) for variable in case.variables)


def worse_than_promised(case: Case, columns: Sequence[Column]) -> tuple[str, ...]:
    """Sentences about objectives that are worse in the last column than in the first by more than `WORSE`.

    There are none about objectives of weight 0, which a run only reports.
    """
    if not columns or not all(columns[k].evaluation.status.usable for k in (0, -1)):
        return ()
    told = []
    for objective in case.objectives_that_count:
        before, now = (columns[k].evaluation.objectives[objective.name] for k in (0, -1))
        loss = (before - now if objective.sense == "maximize" else now - before) / abs(before) if before else 0.0
        if loss > WORSE:
            by = f"{loss:.1%}" if loss < TOLD_AS_FAR else "far"
            told.append(
                f"{objective.name} of the final design is {by} worse than the full design promised: "
                f"{now:.6g} in place of {before:.6g}; keep more members"
            )
    return tuple(told)


def _says_all(final: Case, reduced: Case) -> bool:
    """Whether a final case has every objective and constraint of the one that it was made from."""
    names = [objective.name for objective in final.objectives]
    same = names == [objective.name for objective in reduced.objectives]
    return same and len(final.constraints) == len(reduced.constraints)


def _tighter(case: Case) -> tuple[Case, str]:
    """The case with a hundredth of its errors, and in words the tolerance or step by which it gets that."""
    solver = case.solver
    if solver.step is not None:
        step = solver.step / SHORTER
        return replace(case, solver=replace(solver, step=step)), f"step {step:g} s"
    tolerance = max(solver.tolerance / TIGHTER, min(solver.tolerance, TIGHTEST))
    return replace(case, solver=replace(solver, tolerance=tolerance)), f"tolerance {tolerance:g}"


def _read(text: str, place: Path) -> Case:
    """The final case as a user will read it. Raises CaseError where it is none."""
    case = read_case(text, path=place)
    refused = refusals(case)
    if refused:
        raise CaseError(refused, str(place))
    return case


def _difference(case: Case, found: Evaluation) -> float | None:
    """The largest relative difference between the objectives of a case at its own design and those found."""
    if not case.objectives:
        return None
    again = make_engine(case).evaluate(case.start, gradient=False).objectives
    pairs = np.array([[value, found.objectives[name]] for name, value in again.items()])
    size = np.maximum(np.abs(pairs).max(axis=1), np.finfo(np.float64).tiny)
    return float((np.abs(pairs[:, 0] - pairs[:, 1]) / size).max())
