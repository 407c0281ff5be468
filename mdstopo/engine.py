"""A case, compiled once: evaluate designs, simulate, hand the optimiser its problem.

`Evaluator` reads like the paper's Section III.C: simulate the load cases that objectives or constraints are of,
evaluate these, differentiate. Each load case is one scene; objectives of one load case share its simulation.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from time import perf_counter
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mdstopo.case.methods.integrators import ADAPTIVE, AUTO, INTEGRATORS, SMOOTH, STIFF
from mdstopo.case.methods.integrators import having as integrators_having
from mdstopo.case.methods.sensitivities import SENSITIVITIES, chosen
from mdstopo.case.methods.sensitivities import having as methods_having
from mdstopo.case.model import Case, MemberGroup, ReducedResponse, ResponseRow
from mdstopo.case.scene.candidates import mirrored_groups
from mdstopo.case.text.errors import CaseError
from mdstopo.compiler.threads import CallOutcome, allowed, side_by_side
from mdstopo.evaluation import USUAL, Evaluation, FloatArray, MotionValues, Peak, Rows, Shape
from mdstopo.integrators.integrator_choice import choose, method_of
from mdstopo.integrators.scene_driver import DriverOptions, Method, ResponseResult, Scene, SceneDriver
from mdstopo.integrators.steps import WORK, work_named
from mdstopo.integrators.trajectory import Trajectory
from mdstopo.scene.border import border_of
from mdstopo.scene.design import Design, checked
from mdstopo.scene.family import beyond_springs, collocates
from mdstopo.scene.origin import extent_of, origin_of, seen_from, starting_places
from mdstopo.scene.refusals import no_derivatives, refusals
from mdstopo.scene.settled import Settled
from mdstopo.scene.vibration_modes import Modes
from mdstopo.sensitivity.scene_family import SceneFamily
from mdstopo.sensitivity.springs_driver import SPRINGS
from mdstopo.status import Status
from mdstopo.warm import BackgroundCompiler

if TYPE_CHECKING:
    from mdstopo.error_estimate import Estimator
    from mdstopo.general.driver.general_driver import GeneralDriver
    from mdstopo.optimizer.problem import Problem
    from mdstopo.optimizer.scalarisation import Scalarisation
    from mdstopo.scene.design_map import DesignMap
    from mdstopo.sensitivity.candidate_pass import CandidatePass

#: the motion is computed to the tolerance of the responses; looser than this to half of it, because a gradient may
#: else exceed ten tolerances on scenes whose members turn fast
LOOSEST = 5e-5

#: seconds that a load case takes from which on a thread of its own pays: one costs a tenth of that
WORTH_A_THREAD = 1e-3

#: steps that a time history has at least
HISTORY = 50
#: a method that has derivatives at every time
HISTORIES = methods_having("of_histories")[0]


class Evaluator:
    """A case, compiled once, whose designs can be evaluated again and again.

    in_background: compile with a second process at the first use on a machine; share: what else that does (`warm`).
    sample: 0, or which of the scene's other roundings it computes (`scene.rounding`); what it tells is then not in the
    file's coordinates. beyond: why the kernels of general scenes are taken for a case that does not need them by
    itself, empty where nothing else asks for them. Raises CaseError where the case asks for what the engine cannot do
    yet.
    """

    def __init__(
        self, case: Case, in_background: bool = True, share: Sequence[str] = (), sample: int = 0, beyond: str = ""
    ) -> None:
        refused = refusals(case)
        if refused:
            raise CaseError(refused, str(case.path or case.name))
        self.case = case
        self.beyond = beyond_springs(case) or beyond
        self._usual = choose(case.solver, self.beyond, collocates(case))
        self.sensitivity = chosen(case.solver.sensitivity).name
        kind = INTEGRATORS[self._usual[0]]
        # steps on which some methods of differentiation are defined, to which the choice of `auto` has to give way
        self._lacking = {
            each.name
            for each in SENSITIVITIES.values()
            if case.solver.integrator == AUTO and each.steps and not getattr(kind, each.steps)
        }
        self._may_be_coarse = case.solver.step is not None and kind.finds_step
        self._compiles_in_background = in_background
        self._background = BackgroundCompiler(kind.name, share) if in_background and not self.beyond else None
        self._design_map = _design_map_of(case)
        #: the case whose variables scenes know
        own = case if self._design_map is None else self._design_map.case
        #: what the scenes' coordinates are measured from, and the case in these
        self._origin = origin_of(case)
        self._near = seen_from(own, self._origin)
        if sample:
            from mdstopo.scene.rounding import rounded_otherwise

            self._near = rounded_otherwise(own, self._origin, extent_of(case), sample)
        self._family = _family(self.beyond)
        self.scenes: Mapping[str, Scene] = self._family.scenes(self._near)
        self._drivers: dict[str, SceneDriver] = {}
        self._coarse: dict[str, str] = {}
        #: threads for load cases side by side; springs between free bodies share their passes instead
        self.threads = allowed() if self.beyond else 1
        #: how long each load case took when it was last evaluated, with gradients or without (s)
        self._took: dict[tuple[str, bool], float] = {}
        self._n = case.n_design
        self._design = Design(case)
        self._rows = self._design.rows.view()
        self._rows.flags.writeable = False
        # the responses of each load case: objectives, then constraints on a response
        bounded = {i: row for i, row in enumerate(case.constraints) if isinstance(row, ResponseRow)}
        limited = {f"constraints[{i}]": row for i, row in bounded.items()}
        self._limited = dict(zip(bounded, limited, strict=True))
        self._by_load_case: dict[str, dict[str, ReducedResponse]] = {
            name: {o.name: o for o in case.objectives if o.load_case == name}
            | {key: row for key, row in limited.items() if row.load_case == name}
            for name in self.scenes
        }
        self._names = tuple(objective.name for objective in case.objectives)
        #: groups whose alpha^mu has no slope at 0: name, power, their part of alpha
        self._rooted = [
            (group.name, group.power, part)
            for group, part in zip(case.design_groups, case.group_slices.values(), strict=True)
            if group.power < 1.0
        ]
        #: groups with laws whose slopes may be infinite or without a value
        self._unsure = [group.name for group in case.members if any(law.may_lack_slopes for law in group.laws)]
        self._narrower: dict[tuple[str, ...], Evaluator] = {}
        self._others: dict[tuple[Any, ...], Evaluator] = {}
        self._asked_beyond = beyond

    # -- what a run asks

    @property
    def integrator(self) -> str:
        """The integrator's name; `auto` may have to simulate the case's start to choose."""
        return self._choice[0]

    @property
    def integrator_reason(self) -> str:
        """Why this integrator was chosen, as a sentence without a full stop."""
        return self._choice[1]

    @property
    def skipped(self) -> list[str]:
        """What the scenes leave out, and why; one sentence each."""
        notes: list[str] = []
        for scene in self.scenes.values():
            notes += [note for note in scene.skipped if note not in notes]
        unused = [name for name, responses in self._by_load_case.items() if not responses and self.case.objectives]
        return notes + [f"load case {name}: nothing looks at it" for name in unused]

    @property
    def held(self) -> int:
        """How many bytes of steps are kept between calls."""
        return sum(driver.room.nbytes for driver in self._drivers.values())

    def evaluate(
        self, alpha: FloatArray, gradient: bool = True, sensitivity: str | None = None, rows: Rows = USUAL
    ) -> Evaluation:
        """Objectives, and on demand gradients, of a design alpha (N,), finite and >= 0 (ValueError otherwise).

        Behind alpha there may be the values (P,) of the case's variables; else these have their initial ones.
        sensitivity: one of the methods; default the case's. rows: which peaks are told, and what of them;
        constant_load tells no `Peak.across`.
        """
        method = sensitivity or self.sensitivity
        if gradient and self.case.variables and not SENSITIVITIES[method].by_parameters:
            raise CaseError(
                [self.case.marks.mistake(*no_derivatives(self.case, method))],
                str(self.case.path or self.case.name),
            )
        other = self._other_of(method, gradient)
        if other is not None:
            return other.evaluate(alpha, gradient, method, rows)
        seen = self._seen  # first: a driver that is made may simulate a design of its own
        stated = self._design.take(alpha)
        design, design_map = self.computed(stated), self._design_map
        edge = self._without_slope(stated, gradient)
        nowhere = "" if design_map is None else design_map.why_not(False)
        gradient = gradient and not edge
        exact = gradient and SENSITIVITIES[method].comes_with_values
        status, message, grazing = Status.OK, "", ""
        all_peaks: dict[str, tuple[Peak, ...]] = {}
        work: list[list[int]] = []
        begun = {} if nowhere else self._side_by_side(design, exact, rows)
        if nowhere:
            status, message = Status.NON_FINITE, nowhere
        for name, keys, driver in () if nowhere else seen:
            too_coarse = self._coarse_step(name, design)
            if too_coarse:
                status, message = Status.STEP_TOO_LARGE, too_coarse
                break
            result = begun[name].result() if begun else self._timed(name, driver, design, exact, rows)
            status, diagnosis = self._verdict(name, design, result)
            gradients, across = (result.gradients, result.across) if exact else (None, None)
            if status.ok and gradient and not exact:
                found = cast("GeneralDriver", driver).differentiate(method, design, result, rows.cones)
                status, diagnosis, gradients, across = found.status, found.message, found.gradients, found.across
            work.append(driver.work.tolist())
            message = diagnosis or message
            if not status.ok:
                break
            if result.grazing >= 0:
                grazing = driver.member(result.grazing)
            if design_map is not None:
                pulled = (None if each is None else design_map.pull_back(each) for each in (gradients, across))
                gradients, across = pulled
            for j, key in enumerate(keys):
                all_peaks[key] = _peaks(result, j, gradients, across, driver.shapes[j])
        if edge and status.ok:
            status, message = Status.NO_GRADIENT, edge
        if grazing and gradient and status.ok:
            status, message = Status.GRAZING, grazing
        if self._unsure and gradient and status.usable and not _has_slopes(all_peaks):
            where = "group " if len(self._unsure) == 1 else "one of the groups "
            message = f"a slope of a formula of {where}{', '.join(self._unsure)} is infinite or has no value"
            status = Status.NO_GRADIENT
        return self._evaluation(all_peaks, gradient, work_named(_total(work)), status, message)

    def _other_of(self, method: str, gradient: bool) -> "Evaluator | None":
        """The evaluator that differentiates by a method in this one's place, None where this one does: the integrator
        has to be one on whose steps the method is defined, and the kernels those that have the method."""
        if method in self._lacking:
            return self._general(method, integrators_having(SENSITIVITIES[method].steps)[0])
        if self.beyond or not gradient or SENSITIVITIES[method].comes_with_values:
            return None
        return self._general(method, self.integrator)

    def _general(self, method: str, integrator: str) -> "Evaluator":
        """An evaluator of the same case with that integrator and kernels of general scenes, which have the method.

        The case keeps its own method: one with priced candidates has gradients by all methods, but is not optimised by
        all.
        """
        key = ("general", method, integrator)
        if key not in self._others:
            case = replace(self.case, solver=replace(self.case.solver, integrator=integrator))
            beyond = self._asked_beyond or f"the sensitivity method {method}"
            self._others[key] = Evaluator(case, self._compiles_in_background, beyond=beyond)
        return self._others[key]

    def _side_by_side(self, design: FloatArray, exact: bool, rows: Rows) -> dict[str, CallOutcome]:
        """Outcomes of all load cases by name, evaluated side by side on threads; empty where that does not pay.

        The first evaluation with gradients and the first one without take one load case after the other: either may
        have to compile.
        """
        if self.threads < 2 or len(self._seen) < 2 or self._may_be_coarse:
            return {}
        took = {name: self._took.get((name, exact), 0.0) for name, _, _ in self._seen}
        if not min(took.values()) > 0.0 or sorted(took.values())[-2] < WORTH_A_THREAD:
            return {}
        calls = {name: partial(self._timed, name, driver, design, exact, rows) for name, _, driver in self._seen}
        longest_first = sorted(calls, key=took.__getitem__, reverse=True)
        found = side_by_side([calls[name] for name in longest_first], self.threads)
        return dict(zip(longest_first, found, strict=True))

    def _timed(self, name: str, driver: SceneDriver, design: FloatArray, exact: bool, rows: Rows) -> ResponseResult:
        """Evaluate one load case; how long it took is noted."""
        began = perf_counter()
        result = driver.evaluate(design, exact, rows)
        self._took[name, exact] = perf_counter() - began
        return result

    def with_errors(self, alpha: FloatArray, found: Evaluation, sensitivity: str | None = None) -> Evaluation:
        """What `evaluate` found at alpha (N,) with that sensitivity, and estimates of its errors, or why not."""
        method = sensitivity or self.sensitivity
        other = self._other_of(method, bool(found.gradients))
        if other is not None:
            return other.with_errors(alpha, found, sensitivity)
        errors = self._estimator.errors(self.design(alpha), found, sensitivity)
        return found._replace(errors=errors, message=found.message or self._estimator.why)

    @cached_property
    def _estimator(self) -> "Estimator":
        from mdstopo.error_estimate import Estimator

        return Estimator(self)

    def pricing_states(self, weights: Mapping[str, Sequence[float]]) -> Any:
        """The pricing states of a weighted sum of peaks of the last evaluation: from them the price of any member
        follows.

        weights: of the peaks of each objective, and of each constraint on a response by its key path, in their order.
        After an evaluation with gradients.
        """
        parts = []
        for _, keys, driver in self._seen:
            factor = np.zeros(driver.rows.shape[:2])
            for j, key in enumerate(keys):
                factor[j, : len(weights[key])] = weights[key]
            parts.append(driver.pricing_states(factor))
        return type(parts[0]).of_all(parts)

    def candidates_of(self, group: MemberGroup, count: int | None = None) -> "CandidatePass[Any]":
        """The candidates of a priced group, each with its mirror images; count: about so many of them, None: all."""
        images = next(each for each in mirrored_groups(self.case) if group.name in {own.name for own in each})
        order = {each.name: place for place, each in enumerate(self.case.members)}
        places = [order[group.name], *(order[each.name] for each in images if each.name != group.name)]
        own = replace(self._near.members[places[0]], upper=min(each.upper for each in images))
        ends = (group.from_world, group.to_world)
        if self._near is not self.case:
            ends = starting_places(self._near.bodies, own)
        return self._family.candidates(self.scenes, places, own, ends, count)

    def otherwise(self, sample: int = 0, **solver: Any) -> "Evaluator":
        """An evaluator of the same case with other solver settings, made once for each set of them.

        sample: as of the constructor.
        """
        key = (sample, *sorted(solver.items()))
        if key not in self._others:
            case = replace(self.case, solver=replace(self.case.solver, **solver))
            self._others[key] = Evaluator(case, self._compiles_in_background, sample=sample, beyond=self._asked_beyond)
        return self._others[key]

    def trajectory(self, alpha: FloatArray, load_case: str) -> Trajectory:
        """The motion of one load case with the design alpha (N,)."""
        design = self.computed(self.design(alpha))
        driver = self.driver(load_case)
        too_coarse = self._coarse_step(load_case, design)
        status, steps = driver.simulate(design)
        message = ""
        if not status.ok:
            status, message = driver.explain(design, status, float(steps.t[-1]), steps.q[-1], steps.v[-1])
        elif too_coarse:
            status, message = Status.STEP_TOO_LARGE, too_coarse
        else:
            meeting = driver.met(steps.count)
            if meeting >= 0:
                status, message = Status.ZERO_LENGTH, driver.member(meeting)
        work = work_named(driver.work.tolist())
        bodies = next(each.bodies for each in self.case.load_cases if each.name == load_case)
        names = tuple(body.name for body in bodies)
        return Trajectory.of(load_case, steps, status, message, work, border_of(self.case, bodies), names)

    def trajectory_with_values(self, alpha: FloatArray, load_case: str) -> tuple[Trajectory, MotionValues]:
        """The motion of one load case with the design alpha (N,), and what objectives and constraints of it come to:
        values as of `evaluate`, from the same motion. It is computed once, unless integrals need steps that end
        elsewhere, or values are those of another integrator."""
        trajectory = self.trajectory(alpha, load_case)
        responses = self._by_load_case[load_case]
        if not responses or not trajectory.status.ok:
            return trajectory, MotionValues(trajectory.status, trajectory.message)
        other = self._other_of(self.sensitivity, gradient=False)
        if other is not None:  # values are those of the integrator that gradients have, as of `evaluate`
            return trajectory, other.trajectory_with_values(alpha, load_case)[1]
        if self._design_map is not None and (nowhere := self._design_map.why_not(False)):
            return trajectory, MotionValues(Status.NON_FINITE, nowhere)
        driver = self.driver(load_case)
        result = driver.evaluate_simulated()
        status, message = self._verdict(load_case, self.computed(self.design(alpha)), result)
        if not status.usable:
            return trajectory, MotionValues(status, message)
        peaks = {key: _peaks(result, j, None, None, driver.shapes[j])[0] for j, key in enumerate(responses)}
        return trajectory, MotionValues(status, message, peaks)

    def histories(self, alpha: FloatArray, objective: str) -> tuple[Status, FloatArray, FloatArray]:
        """Times (T,) of the steps and dg(t)/dalpha (T, N) of an objective's response at them, by `direct`.

        Adaptive steps that are too few to see a curve by are replaced by `HISTORY` fixed ones, or more: none is longer
        than the shortest of them.
        """
        status, t, lines = self._histories(self.design(alpha), objective)
        if not status.ok or len(t) > HISTORY or self.case.solver.step is not None:
            return status, t, lines
        step = min((t[-1] - t[0]) / HISTORY, float(np.diff(t).min()))
        denser = self.otherwise(step=step)._histories(self.design(alpha), objective)
        return denser if denser[0].ok else (status, t, lines)

    def _histories(self, design: FloatArray, objective: str) -> tuple[Status, FloatArray, FloatArray]:
        load_case = next(each.load_case for each in self.case.objectives if each.name == objective)
        place = list(self._by_load_case[load_case]).index(objective)
        if not self.beyond:
            return self._general(HISTORIES, self.integrator)._histories(design, objective)
        driver = cast("GeneralDriver", self.driver(load_case))
        status, t, lines = driver.histories(self.computed(design), place)
        return status, t, lines if self._design_map is None else self._design_map.pull_back(lines)

    def problem(self, scalarisation: "Scalarisation | None" = None) -> "Problem":
        """The case as the optimiser sees it; several objectives need a scalarisation."""
        from mdstopo.design_problem import DesignProblem

        return DesignProblem(self, scalarisation)

    def with_objectives(self, objectives: Sequence[str]) -> "Evaluator":
        """An evaluator of the same case with some of its objectives alone: the others are not computed."""
        names = tuple(objectives)
        if names == tuple(objective.name for objective in self.case.objectives):
            return self
        if names not in self._narrower:
            chosen = tuple(objective for objective in self.case.objectives if objective.name in names)
            narrower = replace(self.case, objectives=chosen)
            self._narrower[names] = Evaluator(narrower, in_background=False, beyond=self._asked_beyond)
        return self._narrower[names]

    def settled(self, alpha: FloatArray, load_case: str) -> Settled | None:
        """How far the start moves to be at rest with alpha (N,); None where the case does not settle, or cannot."""
        return self.driver(load_case).settled(self.computed(self.design(alpha))) if self.case.solver.settle else None

    def degrees_of_freedom(self, load_case: str) -> int:
        """The number of free coordinates, less that of the independent rows of joints."""
        return self.scenes[load_case].degrees_of_freedom

    def natural_frequencies(self, alpha: FloatArray, load_case: str) -> FloatArray:
        """Angular frequencies (rad/s) of small motion about the start, rising; unstable modes are left out."""
        return self.start_modes(alpha, load_case).frequencies

    def start_modes(self, alpha: FloatArray, load_case: str) -> Modes:
        """Small motion about the start; freedoms are those of `scenes[load_case].bodies`, in their order."""
        return self.driver(load_case).start_modes(self.computed(self.design(alpha)))

    # -- how

    def design(self, alpha: FloatArray) -> FloatArray:
        """alpha as (N,) float64, with the values of variables (P,) behind it; ValueError where it is no design."""
        return checked(self.case, alpha)

    def computed(self, design: FloatArray) -> FloatArray:
        """The design that the compiled scenes have for a design (N + P,) of the case: with what follows from defined
        names."""
        return design if self._design_map is None else self._design_map.design(design)

    @cached_property
    def _seen(self) -> list[tuple[str, tuple[str, ...], SceneDriver]]:
        """The load cases that objectives or constraints are of: name, the names of these, driver."""
        return [
            (name, tuple(responses), self.driver(name)) for name, responses in self._by_load_case.items() if responses
        ]

    def _without_slope(self, design: FloatArray, gradient: bool) -> str:
        """Why a gradient that is wanted is not there at this design, or nothing: alpha^mu has no slope at 0 where
        mu < 1, and what follows from defined names may have none."""
        if not gradient:
            return ""
        if self._design_map is not None and (infinite := self._design_map.why_not(True)):
            return infinite
        for name, power, part in self._rooted:
            if np.any(design[part] == 0.0):
                return f"alpha = 0 in group {name}, whose power {power:g} is below 1"
        return ""

    @cached_property
    def _choice(self) -> tuple[str, str]:
        """The integrator, and why; where dampers may hold steps short, motions from the case's start tell (`auto`)."""
        usual = self._usual
        if not self.may_simulate_to_choose:
            return usual
        from mdstopo.general.driver.stiffness import held_short, windows_held_short

        if usual[0] == SMOOTH:
            held = self._held(SMOOTH, windows_held_short)
            if not held:
                return usual
            name, why = choose(self.case.solver, self.beyond)
            usual = name, f"{why}; {held}"
        held = self._held(ADAPTIVE, held_short)
        return (STIFF, held) if held else usual

    def _held(self, name: str, told: "Callable[[GeneralDriver, FloatArray], str]") -> str:
        """Of the first load case in which steps of an integrator are held short what tells so; else drivers stay."""
        method = method_of(name, self.case.solver)
        drivers = {
            load_case: self._made(load_case, method) for load_case, responses in self._by_load_case.items() if responses
        }
        for driver in drivers.values():
            held: str = told(cast("GeneralDriver", driver), self.computed(self._design.take(self.case.start)))
            if held:
                return held
        self._drivers.update(drivers)
        return ""

    def driver(self, name: str) -> SceneDriver:
        """The buffers and compiled entries of one load case, made at their first use."""
        if name not in self._drivers:
            method = method_of(self.integrator, self.case.solver)
            if name not in self._drivers:  # the choice of the integrator may have made it
                self._drivers[name] = self._made(name, method)
        return self._drivers[name]

    def compile_responses(self) -> None:
        """Compile what evaluates responses and gradients from steps, without any steps (`SceneDriver`)."""
        self._unused().compile_responses()

    def compile_method(self, method: str) -> None:
        """Compile what a method of differentiation calls beside that, where another process can: by the kernels of
        general scenes."""
        driver = (self._other_of(method, gradient=True) or self)._unused()
        if not SENSITIVITIES[method].comes_with_values:
            cast("GeneralDriver", driver).compile_method(method)

    def compile_steps(self) -> None:
        """Compile what makes steps of a scene with joints or other laws, without making any."""
        cast("GeneralDriver", self._unused()).compile_steps()

    def _unused(self) -> SceneDriver:
        """A driver to compile with. Nothing is computed, which would need what another process is compiling: neither
        whether joints fit, nor whether the steps serve that `auto` takes."""
        return self._made(next(iter(self.scenes)), method_of(self._usual[0], self.case.solver), fits=False)

    @property
    def may_simulate_to_choose(self) -> bool:
        """Whether `auto` simulates the case's start to choose an integrator."""
        chooses = self.case.solver.integrator == AUTO and self.case.solver.step is None
        if not chooses or not self.beyond or self._usual[0] not in (ADAPTIVE, SMOOTH) or self.case.dimension > 2:
            return False
        from mdstopo.general.scene.variables import has_damping

        return has_damping(self.case)

    def _made(self, name: str, method: Method, fits: bool = True) -> SceneDriver:
        """A driver of one load case by a method; fits: as of `DriverOptions`."""
        solver, responses = self.case.solver, tuple(self._by_load_case[name].values())
        tolerance, step = _of_motion(solver.tolerance), solver.step or 0.0
        options = DriverOptions(method, tolerance, step, responses, self._design.values, self._background, fits)
        driver = self._family.driver(self._near, self.scenes[name], options)
        if method.kind.finds_step and solver.step is None:
            from mdstopo.integrators.default_step import default_step

            driver.settings[2] = default_step(driver, self._near.start)
        return driver

    def _coarse_step(self, name: str, design: FloatArray) -> str:
        """Why the fixed step of generalized_alpha is far too large for a load case, or nothing; asked once."""
        if not self._may_be_coarse:
            return ""
        if name not in self._coarse:
            from mdstopo.coarse import coarse

            self._coarse[name] = coarse(self.driver(name), design)
        return self._coarse[name]

    def _verdict(self, name: str, design: FloatArray, result: ResponseResult) -> tuple[Status, str]:
        """The status of an evaluated load case, and where its motion cannot be trusted, which member or joint is the
        cause."""
        if result.status.ok and result.meeting < 0 and result.unresolved < 0:
            return result.status, ""
        driver = self.driver(name)
        if result.message:
            return result.status, result.message
        if result.status.ok and result.meeting >= 0:
            return Status.ZERO_LENGTH, driver.member(result.meeting)
        if result.status.ok:
            return Status.UNRESOLVED, driver.member(result.unresolved)
        status, steps = driver.simulate(design)
        if status.ok:  # the motion alone; it was to be computed again with steps that integrals over time need
            return result.status, (
                "with the steps that integrals over time need; an integral next to zero needs very many: add a small "
                "amount to its response, by an expression"
            )
        return driver.explain(design, status, float(steps.t[-1]), steps.q[-1], steps.v[-1])

    def _evaluation(
        self,
        all_peaks: Mapping[str, tuple[Peak, ...]],
        gradient: bool,
        work: dict[str, int],
        status: Status,
        message: str,
    ) -> Evaluation:
        if not status.usable:
            lost = (Peak(np.nan, np.nan, None),)
            keys = [*self._names, *self._limited.values()]
            all_peaks = {key: all_peaks.get(key, lost) if status is Status.NO_GRADIENT else lost for key in keys}
        objectives: dict[str, float] = {}
        times: dict[str, float] = {}
        peaks: dict[str, tuple[Peak, ...]] = {}
        slopes: dict[str, FloatArray] = {}
        for name in self._names:
            found = peaks[name] = all_peaks[name]
            times[name], objectives[name], slope, *_ = found[0]
            if gradient and slope is not None:
                slopes[name] = slope
        constraints, rows = self._design.excess.copy(), self._rows
        limits: dict[int, tuple[Peak, ...]] = {}
        if self._limited or self._design.moving:
            rows = rows.copy()
            for i, key in self._limited.items():
                limits[i] = all_peaks[key]
                peak = all_peaks[key][0]
                constraints[i] = peak.value - self._design.bounds[i]
                rows[i] = np.nan if peak.gradient is None else peak.gradient
        made = Evaluation(objectives, slopes, times, constraints, rows, peaks, work, status, message, limits)
        return self._parted(made) if self.case.variables else made

    def _parted(self, found: Evaluation) -> Evaluation:
        """What was found with respect to a whole design (N + P,), told by alpha and by variables."""
        n, named = self._n, self.case.space.named
        return found._replace(
            gradients={name: slope[:n] for name, slope in found.gradients.items()},
            constraint_gradients=found.constraint_gradients[:, :n],
            variables=named(self._design.values.copy()),
            variable_gradients={name: named(slope) for name, slope in found.gradients.items()},
            constraint_variable_gradients=named(found.constraint_gradients),
        )


def _design_map_of(case: Case) -> "DesignMap | None":
    """How defined names that are design variables reach the scenes, where the case has such."""
    if case.follows is None:
        return None
    from mdstopo.scene.design_map import DesignMap, refuse_bounds

    refuse_bounds(case)
    return DesignMap(case)


def _total(counts: list[list[int]]) -> list[int]:
    """Work counts (WORK,) of all load cases together."""
    return counts[0] if len(counts) == 1 else [sum(each) for each in zip([0] * WORK, *counts, strict=True)]


def _of_motion(tolerance: float) -> float:
    return min(tolerance, max(LOOSEST, 0.5 * tolerance))


def _has_slopes(all_peaks: Mapping[str, tuple[Peak, ...]]) -> bool:
    """Whether all derivatives of the responses are finite."""
    rows = (peak.gradient for peaks in all_peaks.values() for peak in peaks)
    return all(row is None or bool(np.isfinite(row).all()) for row in rows)


def _family(beyond: str) -> SceneFamily:
    """The kernels that a case needs; beyond: what in it goes beyond springs between free bodies (`scene.family`)."""
    if not beyond:
        return SPRINGS
    from mdstopo.general.driver.general_driver import GENERAL

    return GENERAL


def _peaks(
    result: ResponseResult, j: int, gradients: FloatArray | None, across: FloatArray | None, shape: Shape
) -> tuple[Peak, ...]:
    """What was found of objective j; gradients (n_obj, R, N) and across of all rows, of which copies are kept."""
    peaks: tuple[Peak, ...] = ()
    gradient = across_of_row = None
    rows = result.rows.item
    for r in range(result.row_counts.item(j)):
        if gradients is not None:
            gradient = gradients[j, r].copy()
            gradient.setflags(False)
        if across is not None and shape == "norm":
            across_of_row = across[j, r].copy()
            across_of_row.setflags(False)
        peaks += (Peak(rows(j, r, 0), rows(j, r, 1), gradient, across_of_row, shape),)
    return peaks
