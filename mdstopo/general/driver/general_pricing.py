"""From Python to the compiled entries that price candidates of any laws (`pricing_states`, `candidate_prices`)."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mdstopo.case.laws import Law
from mdstopo.case.model import GROUND, Case, MemberGroup
from mdstopo.compiler.threads import allowed
from mdstopo.general.design.followed_member import AT_NODES, degree_of
from mdstopo.general.driver.fewer_states import FewerStates, all_stages, fewer_states
from mdstopo.general.driver.row_gradients import sign_of, wanted_rows
from mdstopo.general.model.general_model import CODE, GROUP, PAIR, ROW, GeneralModel, pack_general
from mdstopo.general.model.priced_candidates import (
    ARRAYS,
    BEHIND_FEW,
    FIELDS,
    FIRST_NODE,
    FOLLOWED,
    NODE,
    NODES,
    NONE,
    PART,
    POINT,
    POWERS,
    WHOLE,
    PricedCandidates,
)
from mdstopo.general.pricing import candidate_prices as kernels
from mdstopo.general.pricing.pricing_states import OF_A_ROW, keep_states, states_of_sum
from mdstopo.general.pricing.sampled_works import OF_CHANGES, sample_works
from mdstopo.general.responses.extremes import COLUMNS, FRACTION, RATE, STEP
from mdstopo.general.scene.compile_general import GeneralScene
from mdstopo.general.scene.dimension import dimension_of, in_frame
from mdstopo.general.scene.variables import as_computed
from mdstopo.general.steps.step_history import FIRST
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics
from mdstopo.mechanics.laws.law_table import SPRING, kernels_of, may_switch
from mdstopo.scene.bodies import stands_as
from mdstopo.scene.origin import starting_places
from mdstopo.scene.springs_model import FloatArray, IndexArray
from mdstopo.sensitivity.candidate_pass import SMOOTH_ERROR, CandidatePass
from mdstopo.sensitivity.springs_candidate_prices import ERROR, TILE_NUMBERS
from mdstopo.sensitivity.tile_interpolation import PLACES, ROOM

if TYPE_CHECKING:
    from mdstopo.general.driver.general_driver import GeneralDriver

#: by how much of the simulated time it is before the end of a step that decides in which mode a candidate is there: a
#: built one switches there at most by rounding earlier
SIDE = 1e-8
#: tiles from which on it pays to find fewer states, and candidates from which those that are sampled are chosen
MANY_TILES, DRAWN = 1000, 256
#: tiles whose prices are compared, and by how much they may differ, relative to what a pass may be off
COMPARED_TILES, SHARE_OF_FEWER = 8, 0.2


class ScenePricingStates(NamedTuple):
    """The pricing states of one load case: from them the price of any member in a weighted sum of rows follows.

    case, scene: as compiled. model: of the run, whose segments may be more than the scene's. pairs: the number of each
    pair among those that are kept. steps: where the law of a group switches. The others as of `states_of_sum`.
    """

    case: Case
    scene: GeneralScene
    model: GeneralModel
    pairs: dict[int, int]
    pose: FloatArray
    change: FloatArray
    pose_a: FloatArray
    energy: FloatArray
    when: FloatArray
    segment: IndexArray
    steps: "Steps | None"


class PricingStates(NamedTuple):
    """The pricing states of all load cases and samples, from which the price of any member follows."""

    scenes: tuple[ScenePricingStates, ...]

    @classmethod
    def of_all(cls, parts: "Sequence[PricingStates]") -> "PricingStates":
        """The pricing states of several motions together."""
        return cls(tuple(scene for part in parts for scene in part.scenes))


class _Rows(NamedTuple):
    """Rows and integrals with their weights, as `states_of_sum` takes them."""

    which: IndexArray
    rows: FloatArray
    factor: FloatArray
    integrals: IndexArray
    share: FloatArray


def pricing_states_of(driver: "GeneralDriver", factor: FloatArray) -> PricingStates:
    """The states from which prices follow, of the rows of a driver's last evaluation times factor (n_resp, R)."""
    model, count = driver.model_of_run, driver.count
    index = driver.index_of_steps()
    chosen = _rows_of(driver, factor)
    pairs = {int(block[PAIR]): None for block in model.block if driver.case.members[block[GROUP]].candidates}
    size = driver.scene.kinematics
    n_state, each = int(index[count, FIRST]) + OF_A_ROW * len(chosen.rows), size.freedoms
    pose = np.zeros((n_state, len(pairs), size.pose_size))
    change, pose_a = np.zeros((2, n_state, len(pairs), each))
    energy, when, segment = np.zeros(n_state), np.zeros(n_state), np.full(n_state, -1)
    scratch = np.zeros((1, len(driver.padded)))
    arguments: tuple[Any, ...] = (
        *driver.steps_arguments(count)[:4], driver.limits, count, *chosen, np.array(list(pairs), dtype=np.int64),
        driver.room, driver.room_ints, driver.member_state, scratch, pose, change, pose_a, energy, when, segment,
        driver.work,
    )  # fmt: skip
    states_of_sum(*arguments)
    numbers = {pair: number for number, pair in enumerate(pairs)}
    own = ScenePricingStates(
        driver.case, driver.scene, model, numbers, pose, change, pose_a, energy, when, segment, None
    )  # fmt: skip
    if any(_modes(law) == FOLLOWED for group in driver.case.priced_groups for law in group.laws):
        own = own._replace(steps=steps_of(driver, own, index, chosen.rows))
    return PricingStates((own,))


def _modes(law: Law) -> int:
    """Which modes a law has for prices, of NONE and FOLLOWED."""
    return NONE if kernels_of(type(law)).modes is None or not may_switch(law) else FOLLOWED


def _is_even(law: Law) -> bool:
    """Whether prices of candidates near each other follow from few of them wherever their modes are the same."""
    own = kernels_of(type(law))
    # what members do is then a polynomial of their permanent sets, of the second degree
    is_linear = own.modes is not None and own.modes.degree == 1
    is_known = own.is_even is not None and own.is_even(law) and (own.permanent_set is None or is_linear)
    return own.modes is None or is_known


def _rows_of(driver: "GeneralDriver", factor: FloatArray) -> _Rows:
    """The rows that a driver has found, each part of it with its weight; factor (n_resp, R): of rows."""
    rows = [
        (row, factor[row.response, row.row] * sign_of(driver, row.response, row.row) * row.share)
        for row in wanted_rows(driver, False)
    ]
    rows = [each for each in rows if each[1] != 0.0]
    integrals = [
        (j, reduction.is_squared, factor[j, 0] * driver.rows[j, 0, RATE])
        for j, reduction in enumerate(driver.scene.reductions)
        if reduction.is_integral and factor[j, 0] != 0.0
    ]
    return _Rows(
        np.array([[row.response, 0] for row, _ in rows], dtype=np.int64).reshape(-1, 2),
        np.array([row.at for row, _ in rows]).reshape(-1, COLUMNS),
        np.array([weight for _, weight in rows], dtype=np.float64),
        np.array([each[:2] for each in integrals], dtype=np.int64).reshape(-1, 2),
        np.array([each[2] for each in integrals], dtype=np.float64),
    )


class GeneralCandidates(CandidatePass[PricingStates]):
    """The candidates of a group of any laws, each with its mirror images: their price is what all change together.

    places: the numbers of the group and of its mirror images in the case. The rest as of `CandidatePass`.
    """

    def __init__(
        self,
        places: Sequence[int],
        group: MemberGroup,
        homes: tuple[FloatArray, FloatArray],
        count: int | None = None,
    ) -> None:
        # as `scene.origin.ends_of` has it
        super().__init__(group, homes, group.body_to == GROUND, count)
        self._places = tuple(places)
        self._last: tuple[PricingStates, tuple[IndexArray, FloatArray]] | None = None
        self._few: tuple[PricingStates, list[FewerStates | None]] | None = None

    def fill_tiles(
        self, states: PricingStates, common: FloatArray, which: IndexArray, out: FloatArray, prices: FloatArray
    ) -> None:
        """See `CandidatePass.fill_tiles`."""
        self._fill_tiles(states, common, which, self._fewer(states, common), out, prices)

    def _fill_tiles(
        self,
        states: PricingStates,
        common: FloatArray,
        which: IndexArray,
        few: list[FewerStates | None],
        out: FloatArray,
        prices: FloatArray,
    ) -> None:
        """Price tiles.

        states, common, which, out, prices: as of `CandidatePass.fill_tiles`. few: of each run, or of none.
        """
        packed = (*self._packed_scene(states), *self._packed(states, self.chosen, few))
        kernels.price_tiles(*packed, *self.smoothness(states), common, *self.by_tile, which, allowed(), out, prices)

    def prices_between(self, states: PricingStates, a: IndexArray, b: IndexArray) -> FloatArray:
        """The derivatives (K,) by alpha of members from first points to second ones."""
        if self._last is None or self._last[0] is not states:
            self._last = states, self._packed(states, (slice(None), slice(None)))
        found, scene = np.empty(len(a)), self._packed_scene(states)
        for start in range(0, len(a), PLACES):
            part = slice(start, start + PLACES)
            places = np.stack([a[part], b[part]]).astype(np.int64)
            out = np.empty(places.shape[1])
            kernels.price_places(*scene, *self._last[1], places, out)
            found[part] = out
        return found

    def grids(self, states: PricingStates) -> list[tuple[FloatArray, FloatArray]]:
        """See `CandidatePass.grids`: mirror images and scenes may have other points."""
        found = {}
        for scene in states.scenes:
            for place in self._places:
                _, _, first, second, _, _ = self._points(scene, place, self.chosen)
                found[first.tobytes(), second.tobytes()] = first.T, second.T
        return list(found.values())

    def error(self, states: PricingStates) -> float:
        """See `CandidatePass.error`; 0 where a law may be sharp at places of which bounds do not tell: a few candidates
        in the middle of a tile can then do what none of those beside them does."""
        laws = (law for scene in states.scenes for place in self._places for law in scene.case.members[place].laws)
        return SMOOTH_ERROR if all(_is_even(law) for law in laws) else 0.0

    def _fewer(self, states: PricingStates, common: FloatArray) -> list[FewerStates | None]:
        """Of each run the fewer states for passes; empty where there are few tiles, or prices would not be the same.

        common: as of `fill_tiles`.
        """
        if common[ERROR] == 0.0 or self.shape[0] * self.shape[1] < MANY_TILES:
            return []
        if self._few is None or self._few[0] is not states:
            found = self._find_fewer(states)
            self._few = states, found if self._is_same(states, common, found) else []
        return self._few[1]

    def _find_fewer(self, states: PricingStates) -> list[FewerStates | None]:
        """Of each run the fewer states, or None where its law is not made for them; empty where there are none."""
        scene, packed = self._packed_scene(states), self._packed(states, self.chosen)
        runs = [run for each in states.scenes for place in self._places for run in _runs(each, place)]
        rng = np.random.default_rng(1)
        places = np.stack([rng.integers(0, len(numbers), DRAWN) for numbers in self.chosen])
        found: list[FewerStates | None] = []
        for k, run in enumerate(runs):
            change = run.change[:, 0]
            works = np.empty((len(run.when), OF_CHANGES + change.shape[1], DRAWN))
            degree = sample_works(*scene, *packed, k, places, works) if len(run.step) else 0
            found.append(fewer_states(run.step, works, degree, change, run.energy) if degree else None)
        return found if any(own is not None and len(own.state) for own in found) else []

    def _is_same(self, states: PricingStates, common: FloatArray, few: list[FewerStates | None]) -> bool:
        """Whether prices with fewer states are those with all, of some tiles."""
        if not few:
            return True
        count = self.shape[0] * self.shape[1]
        which = (np.arange(COMPARED_TILES) * count + count // 2) // COMPARED_TILES
        out, prices = np.empty((COMPARED_TILES, TILE_NUMBERS)), np.empty((2, COMPARED_TILES, PLACES))
        self._fill_tiles(states, common, which, [], out, prices[0])
        self._fill_tiles(states, common, which, few, out, prices[1])
        own, others = prices[:, np.isfinite(prices[0])]
        return bool(np.abs(others - own).max(initial=0.0) <= SHARE_OF_FEWER * common[ERROR])

    def _packed_scene(self, states: PricingStates) -> tuple[IndexArray, FloatArray]:
        """A packed scene with room for the members of a tile, and for the numbers of any of the scenes' laws."""
        scene, model = states.scenes[0].scene, states.scenes[0].model
        segments = len(model.active)
        with_tile = model._replace(
            block=np.zeros((1, ROW + 1), dtype=np.int64),
            law=np.zeros((1, model.law.shape[1])),
            active=np.ones((segments, 1), dtype=np.int64),
            level=np.zeros((segments, 1, 2)),
            power=np.ones(1),
            member=np.zeros((len(model.member), ROOM)),
            curves=np.zeros(_most_curves(states)),
        )
        return pack_general(with_tile, scene.kinematics)

    def _packed(
        self,
        states: PricingStates,
        chosen: tuple[IndexArray | slice, IndexArray | slice],
        few: Sequence[FewerStates | None] = (),
    ) -> tuple[IndexArray, FloatArray]:
        """A packed `priced_candidates.PricedCandidates`.

        chosen: which points of both grids. few: of each run, or of none.
        """
        parts = [(scene, place) for scene in states.scenes for place in self._places]
        curves = np.zeros((len(parts), _most_curves(states)))
        points: list[list[FloatArray]] = []
        runs: list[_Run] = []
        rows: list[list[int]] = []
        state = step = node = 0
        for number, (scene, place) in enumerate(parts):
            curves[number, : len(scene.model.curves)] = scene.model.curves
            points.append(self._points(scene, place, chosen))
            for run in _runs(scene, place):
                own = few[len(runs)] if few else None
                if own is not None:
                    run = _with_fewer(run, own)
                code, before, modes = run.row
                ends = state + len(run.when), step + len(run.step)
                rows.append([number, code, state, state + before, ends[0], step, ends[1], modes])
                run.step[:, :FIRST_NODE] += state
                run.step[:, FIRST_NODE] += node
                run.few[run.few[..., BEHIND_FEW] > 0] += state
                runs.append(run)
                (state, step), node = ends, node + len(run.node_pose)
        arrays: tuple[Any, ...] = (
            np.array(rows, dtype=np.int64),
            np.array([run.rest for run in runs]),
            np.array([run.law for run in runs]).reshape(len(runs), -1),
            curves,
            *(np.concatenate([getattr(run, name) for run in runs]) for name in ARRAYS),
            *(np.array(each) for each in zip(*points, strict=True)),
            *(each[k].T for each, k in zip(self.homes, chosen, strict=True)),
        )
        return FIELDS.packed(PricedCandidates(*arrays))

    def _points(
        self, scene: ScenePricingStates, place: int, chosen: tuple[IndexArray | slice, IndexArray | slice]
    ) -> list[FloatArray]:
        """Points of both grids (d, n) as a scene has them: in body frames, at the start, where its case has them.

        place: the number of the group or of a mirror image of it.
        """
        case, load_case = scene.case, scene.scene.load_case
        group, dimension = case.members[place], dimension_of(case)
        names = (group.body_from, group.body_to)[self.order]
        local = [
            in_frame(dimension.frames(load_case), name, points)
            for name, points in zip(names, (group.from_local, group.to_local)[self.order], strict=True)
        ]
        stated = starting_places(case.bodies, group)[self.order]
        home = list(stated)
        if not stands_as(case, load_case):
            bodies = scene.scene.bodies
            home = [
                dimension.places(scene.model.home, bodies.index(name), points)
                for name, points in zip(names, local, strict=True)
            ]
        pairs = (local, home, stated)
        return [each[side][chosen[side]].T for each in pairs for side in range(2)]


class _Run(NamedTuple):
    """A row of `priced_candidates.PricedCandidates.run` with its states, steps and nodes; each as there.

    row: the law's code, how many states there are before the first one whose energy counts, and which modes it has.
    """

    row: tuple[int, int, int]
    rest: float
    law: FloatArray
    pose: FloatArray
    change: FloatArray
    pose_a: FloatArray
    energy: FloatArray
    when: FloatArray
    level: FloatArray
    frame: FloatArray
    step: IndexArray
    step_time: FloatArray
    node_pose: FloatArray
    node_a: FloatArray
    node_change: FloatArray
    node_level: FloatArray
    node_energy: FloatArray
    node_frame: FloatArray
    few: IndexArray
    nearest: FloatArray


def _runs(scene: ScenePricingStates, place: int) -> list[_Run]:
    """The states of each law of a group in a scene; place: the group's number."""
    model, group = scene.model, as_computed(scene.case).members[place]
    blocks = np.flatnonzero(model.block[:, GROUP] == place)
    return [_run_of(scene, k, record) for k, record in zip(blocks.tolist(), group.laws, strict=True)]


def _run_of(scene: ScenePricingStates, k: int, record: Law) -> _Run:
    """The states of the law of block k in a scene."""
    model, pair = scene.model, scene.pairs[int(scene.model.block[k, PAIR])]
    free, code = getattr(record, "free_length", None), int(model.block[k, CODE])
    moves, stores = scene.change[:, pair].any(axis=1), scene.energy != 0.0
    acts = (scene.segment >= 0) & (model.active[scene.segment, k] != 0)
    modes = _modes(record)
    steps = scene.steps if modes == FOLLOWED else None
    before = 0
    if steps is not None:
        states = np.arange(len(scene.when))
    elif code == SPRING and not model.law[k, 1:3].any():
        # forces and energies of springs are summed apart
        moved, stored = np.flatnonzero(acts & moves), np.flatnonzero(acts & stores)
        states, before = np.concatenate([moved, stored]), len(moved)
    else:
        states = np.flatnonzero(acts & (moves | stores))
    change = scene.change[states, pair]
    change[before if before else len(change) :] = 0.0
    level = _level(model, k, scene.segment[states], scene.when[states])
    pose, kinematics = scene.pose[states, pair], scene.scene.kinematics
    frame = _frames(kinematics, pose)
    if steps is None:
        parts = _no_steps(pose.shape[1], change.shape[1], frame.shape[1])
    else:
        parts = _steps_of_law(steps, model, k, pair, kinematics)
    parts = (*parts, *all_stages(parts[0]))
    return _Run(
        (code, before, modes), -1.0 if free is None else float(free), model.law[k],
        pose[:, None], change[:, None], scene.pose_a[states, pair], scene.energy[states],
        scene.when[states], level, frame if modes != NONE else np.zeros_like(frame), *parts,
    )  # fmt: skip


def _with_fewer(run: _Run, own: FewerStates) -> _Run:
    """A run with other states behind its own, over which forces are summed."""
    kept: dict[str, Any] = {
        name: np.concatenate([values, values[own.state]])
        for name in ("pose", "pose_a", "when", "level", "frame")
        for values in [getattr(run, name)]
    }
    return run._replace(
        **kept,
        change=np.concatenate([run.change, own.change[:, None]]),
        energy=np.concatenate([run.energy, own.energy]),
        few=own.few.copy(),
        nearest=own.nearest,
    )


def _frames(kinematics: Kinematics, poses: FloatArray) -> FloatArray:
    """How ends of members move at relative poses (n, POSE), (n, n_frame): d, S, d', S' of `Kinematics.ends`, and the
    norm of S'."""
    place, turn, speed, spin = (each.reshape(len(poses), np.prod(each.shape[1:])) for each in kinematics.ends(poses))
    return np.hstack([place, turn, speed, spin, np.linalg.norm(spin, axis=1)[:, None]])


def _level(model: GeneralModel, k: int, segment: IndexArray, when: FloatArray) -> FloatArray:
    """The tabulated force of the law of block k at times (T,) of segments (T,)."""
    first, slope = model.level[segment, k].T
    force: FloatArray = first + slope * (when - model.times[segment])
    return force


class Steps(NamedTuple):
    """The steps of a motion, in the order in which members that switch go through them, each with its nodes.

    step (K, 5), step_time (K, 2): as of `priced_candidates.PricedCandidates`. segment (K,): in which each is.
    pose (nodes, G, POSE), pose_a, change (nodes, G, D), energy (nodes,): at the nodes.
    """

    step: IndexArray
    step_time: FloatArray
    segment: IndexArray
    pose: FloatArray
    pose_a: FloatArray
    change: FloatArray
    energy: FloatArray


def steps_of(driver: "GeneralDriver", states: ScenePricingStates, index: IndexArray, rows: FloatArray) -> Steps:
    """The steps of a driver's last run, with partial ones and states of rows between them.

    driver: with the run. states: those of its rows. index: of its history. rows (R, COLUMNS): whose states these are.
    """
    count, t = driver.count, driver.states()[0]
    found: list[tuple[tuple[float, int, int, int], list[int], tuple[float, float], tuple[int, float]]] = []
    for w in range(count):
        stages = [int(index[w, FIRST]), int(index[w + 1, FIRST])]
        found.append(((t[w], 3, 0, 0), [*stages, WHOLE], (t[w], t[w + 1] - t[w]), (w, 1.0)))
    for m, row in enumerate(rows):
        k, c, at = int(row[STEP]), float(row[FRACTION]), int(index[count, FIRST]) + OF_A_ROW * m
        used = int((states.segment[at + 1 : at + OF_A_ROW] >= 0).sum())
        begin, length = t[k], t[k + 1] - t[k]
        inside = 0.0 < c < 1.0
        if used:
            stages = [at + 1, at + 1 + used]
            found.append(((begin, 1, m, 0), [*stages, PART], (begin, c * length), (k, c)))
        key = (begin, 1, m, 1) if used else (begin, 4, m, 0) if inside else (begin + max(c, 0.0) * length, 0, m, 0)
        side = -SIDE * (t[count] - t[0]) if c >= 1.0 else 0.0
        found.append((key, [at, at + 1, POINT], (begin + c * length, side), (k, c)))
    found.sort(key=lambda each: each[0])
    moves = states.change.any(axis=(1, 2)) | (states.energy != 0.0)
    step = [
        [*where[:2], NODES * number, where[2], int(moves[where[0] : where[1]].any())]
        for number, (_, where, _, _) in enumerate(found)
    ]
    times = np.array([each[2] for each in found])
    places = np.array([[k, min(c, 1.0) * node] for _, _, _, (k, c) in found for node in NODE])
    (q, out), _, _ = driver.sample_response(-1, places, False, count)
    pose, pose_a = np.zeros((len(places), *states.pose.shape[1:])), np.zeros((len(places), *states.pose_a.shape[1:]))
    pairs = np.array(list(states.pairs), dtype=np.int64)
    keep_states(driver.ints, driver.floats, q, out[0], out[1], pairs, pose, pose_a)
    change, energy = (
        [_between_stages(values, states.when, slice(*where[:2]), *time) for (_, where, time, _) in found]
        for values in (states.change, states.energy)
    )
    return Steps(
        np.array(step, dtype=np.int64).reshape(-1, 5), times, states.segment[[each[0] for each in step]], pose, pose_a,
        np.concatenate(change), np.concatenate(energy),
    )  # fmt: skip


def _between_stages(values: FloatArray, when: FloatArray, stages: slice, begin: float, length: float) -> FloatArray:
    """What sums over the stages of a step are sums of, at the nodes of the step, by its fraction, (NODES, ...).

    It is the polynomial with the same moments: sums over stages of what is smooth in time are exact to a high order.
    values (T, ...): of states: virtual changes of pairs, or weights of the energy. when (T,): their times (s).
    stages: which of them are the step's. begin, length: of the step (s).
    """
    own = values[stages]
    if length <= 0.0 or not own.any():
        return np.zeros((NODES, *own.shape[1:]))
    behind = when[stages] - begin
    degree = degree_of.py_func(len(own), length, behind.max())  # type: ignore[attr-defined]
    at_stages = np.polynomial.legendre.legvander(2.0 * behind / length - 1.0, degree)
    found: FloatArray = np.tensordot(AT_NODES[:, : degree + 1] @ at_stages.T, own, axes=1)
    return found


def _steps_of_law(steps: Steps, model: GeneralModel, k: int, pair: int, kinematics: Kinematics) -> tuple[Any, ...]:
    """The steps in which the law of block k acts, with their nodes, as of `_Run`."""
    acts = model.active[steps.segment, k] != 0
    nodes = np.flatnonzero(np.repeat(acts, NODES))
    step = steps.step[acts].copy()
    step[:, FIRST_NODE] = NODES * np.arange(len(step))
    time = steps.step_time[acts]
    when = (time[:, :1] + time[:, 1:] * NODE).ravel()
    level = _level(model, k, np.repeat(steps.segment[acts], NODES), when)
    pose = steps.pose[nodes, pair]
    kept = pose, steps.pose_a[nodes, pair], steps.change[nodes, pair]
    by_powers = ((values.reshape(-1, NODES) @ POWERS.T).ravel() for values in (level, steps.energy[nodes]))
    return step, time, *kept, *by_powers, _frames(kinematics, pose)


def _no_steps(pose: int, freedoms: int, frame: int) -> tuple[Any, ...]:
    """No steps and nodes, as of `_Run`; pose, freedoms, frame: numbers of a pose, of its change and of a frame."""
    motion = np.zeros((0, pose)), np.zeros((0, freedoms)), np.zeros((0, freedoms))
    nodes = *motion, np.zeros(0), np.zeros(0), np.zeros((0, frame))
    return np.zeros((0, 5), dtype=np.int64), np.zeros((0, 2)), *nodes


def _most_curves(states: PricingStates) -> int:
    """The most numbers that the laws of a scene have."""
    return max(len(scene.model.curves) for scene in states.scenes)
