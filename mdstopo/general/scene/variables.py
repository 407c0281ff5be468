"""Where the design variables of laws and of points stand in a general scene, and the scene's arrays at their values.

Nothing is compiled anew for other values: they are written into the law's row, the free length of members, their ends
(`moved_ends`), and, where they say when a law acts, into the ends of segments. Which block a value belongs to does not
change.
"""

from dataclasses import replace

import numpy as np

from mdstopo.case.laws.expression_law import OfFormulas
from mdstopo.case.laws.law import with_role
from mdstopo.case.model import Case, Law, LoadCase, MemberGroup, Variable
from mdstopo.general.model.general_model import (
    COUNT,
    GROUP,
    MEMBER_EXCESS,
    MEMBER_FREE_LENGTH,
    START,
    VARIED_COLUMNS,
    GeneralModel,
)
from mdstopo.general.scene.further_times import landed
from mdstopo.general.scene.moved_ends import WIDTH, MovedEnds, rows_of_ends
from mdstopo.integrators.integrator_choice import has_coarse_steps
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics
from mdstopo.mechanics.laws import law_table
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: parts of the simulated time, each of one step at least, where a mode may come and go by time alone
WATCHED = 256


def of_law(case: Case, group: MemberGroup, place: int) -> list[Variable]:
    """The design variables that are parameters of one law of a group."""
    return [each for each in case.variables if (group.name, place) in zip(each.groups, each.laws, strict=True)]


def each_member(case: Case, group: MemberGroup, place: int) -> bool:
    """Whether members have parameters of their own in a law, so that each is a block."""
    return any(each.each == "member" for each in of_law(case, group, place))


def lasting_times(case: Case, fine: bool) -> list[float]:
    """Times at which steps have to end because of laws, without those times that vary; fine: as of
    `law_table.breakpoints`."""
    return [
        time
        for group in case.members
        for place, law in enumerate(group.laws)
        for time in law_table.breakpoints(law, fine, frozenset(each.parameter for each in of_law(case, group, place)))
    ]


def watched_times(case: Case, load_case: LoadCase) -> list[float]:
    """Times at which steps end so that modes which come and go by time alone are seen; none where no law has such."""
    if not any(law_table.is_watched(law) for group in case.members for law in group.laws):
        return []
    times: list[float] = np.linspace(load_case.start, load_case.end, WATCHED + 1)[1:-1].tolist()
    return times


def has_damping(case: Case) -> bool:
    """Whether forces of members, bushings or contacts depend on velocities, as the case states them."""
    forces = any(law.depends_on_rate for group in case.members for law in group.laws)
    return forces or bool(case.contacts) or any(any(bushing.damping) for bushing in case.bushings)


def adds_damping(case: Case) -> bool:
    """Whether a force may depend on velocities or accelerations by a parameter that varies."""
    groups = {group.name: group for group in case.members}
    return any(
        variable.parameter in with_role(type(groups[name].laws[law]), "of_rate")
        for variable in case.variables
        for name, law in zip(variable.groups, variable.laws, strict=True)
    )


def _blocks(case: Case, block: IndexArray) -> dict[tuple[str, int], list[int]]:
    """(group, place of the law) -> its blocks, in the order of members."""
    found: dict[tuple[str, int], list[int]] = {}
    k = 0
    for group in case.members:
        for place in range(len(group.laws)):
            count = len(group) if each_member(case, group, place) else 1
            found[group.name, place] = list(range(k, k + count))
            k += count
    assert k == len(block)
    return found


def as_computed(case: Case) -> Case:
    """The case as kernels compute it: laws by formula that equal springs are the built-in ones."""
    if not any(isinstance(law, OfFormulas) for group in case.members for law in group.laws):
        return case
    from mdstopo.general.scene.formula_springs import with_springs

    return with_springs(case)


def varied(case: Case, block: IndexArray) -> IndexArray:
    """(n_varied, 6) which numbers of laws vary (`GeneralModel.varied`); `Placing` sets the column for times at which
    laws begin or end."""
    if not case.variables:
        return np.zeros((0, VARIED_COLUMNS), dtype=np.int64)
    blocks = _blocks(case, block)
    rows = []
    first = 0
    for variable in case.variables:
        for group, law in zip(variable.groups, variable.laws, strict=True):
            own = blocks[group, law]
            record = case.members[int(block[own[0], GROUP])].laws[law]
            place = law_table.place_of(type(record), variable.parameter)
            for i, k in enumerate(own):
                members = int(block[k, START]), int(block[k, START] + block[k, COUNT])
                rows.append([k, place, first + (i if variable.each == "member" else 0), 0, *members])
        first += variable.count
    of_laws = np.array(sorted(rows, key=lambda row: row[2]), dtype=np.int64).reshape(-1, VARIED_COLUMNS)
    return np.concatenate([of_laws, rows_of_ends(case, blocks, block)])


def along(rows: IndexArray) -> FloatArray:
    """(n_varied, WIDTH) the field `GeneralModel.along` before any values are known: zeros."""
    return np.zeros((len(rows), WIDTH))


class Placing:
    """Puts values of the variables into the arrays of one load case."""

    def __init__(self, case: Case, load_case: LoadCase, model: GeneralModel) -> None:
        self._load_case = load_case
        self._settles = case.solver.settle
        self._fine = has_coarse_steps(case.solver)
        #: block -> its law, and which value each parameter takes
        self._taken: dict[int, tuple[Law, dict[str, int]]] = {}
        case = as_computed(case)
        blocks = _blocks(case, model.block)
        first = 0
        for variable in case.variables:
            for name, law in zip(variable.groups, variable.laws, strict=True):
                for i, k in enumerate(blocks[name, law]):
                    record = case.members[int(model.block[k, GROUP])].laws[law]
                    taken = self._taken.setdefault(k, (record, {}))[1]
                    taken[variable.parameter] = first + (i if variable.each == "member" else 0)
            first += variable.count
        self._ends = MovedEnds(case, load_case, model, blocks) if case.movable else None
        self._scene = None
        if case.follows is not None:
            from mdstopo.general.scene.numbers_of_scene import NumbersOfScene  # few cases have such

            self._scene = NumbersOfScene(case, load_case, model)
        self.initial = np.concatenate([each.initials for each in case.variables])

    def at(self, model: GeneralModel, values: FloatArray) -> GeneralModel:
        """The model with the values (P,) of variables in its arrays."""
        if self._scene is not None:  # names of the scene come last
            model = self._scene.at(model, values[len(values) - self._scene.count :])
        if self._ends is not None:
            model = self._ends.at(model, values)
        law, member = model.law.copy(), model.member.copy()
        start, end = self._load_case.start, self._load_case.end
        times: set[float] = set()
        acts: dict[int, tuple[float, float]] = {}
        held: set[int] = set()
        for k, (record, taken) in self._taken.items():
            changed = {name: float(values[c]) for name, c in taken.items()}
            now = replace(record, **changed)
            if law_table.kernels_of(type(now)).data is None:
                law[k] = law_table.parameters(now, [])
            else:
                for name, value in changed.items():
                    place = law_table.place_of(type(now), name)
                    if place < law_table.PARAMETERS:
                        law[k, place] = value
            if "free_length" in changed:
                first = int(model.block[k, START])
                part, free = slice(first, first + int(model.block[k, COUNT])), changed["free_length"]
                was = member[MEMBER_FREE_LENGTH, part].copy()
                member[MEMBER_FREE_LENGTH, part] = free
                member[MEMBER_EXCESS, part] += (was - free) * (was + free)
            if changed.keys() & with_role(type(now), "is_time"):
                times |= {t for t in law_table.breakpoints(now, self._fine) if start < t < end}
                begin = -np.inf if now.active_from is None else now.active_from
                until = np.inf if now.active_until is None else now.active_until
                acts[k] = begin, until
                if self._settles and now.holds:
                    held.add(k)
        model = landed(model._replace(law=law, member=member), sorted(times))
        if not acts:
            return model
        active, varied = model.active.copy(), model.varied.copy()
        middle = 0.5 * (model.times[:-1] + model.times[1:])
        for k, (begin, until) in acts.items():
            active[:, k] = (middle > begin) & (middle < until)
        for row in varied:
            begin, until = acts.get(int(row[0]), (np.nan, np.nan))
            # a law with a force at rest can only begin earlier: if it began later, the equilibrium would be another
            begins = begin == start and int(row[0]) not in held
            row[3] = (row[1] == law_table.ACTIVE_FROM and begins) or (row[1] == law_table.ACTIVE_UNTIL and until == end)
        return model._replace(active=active, varied=varied)

    def with_twins(self, model: GeneralModel, bodies: Kinematics) -> GeneralModel:
        """The arrays at the values that were put in last, with the scenes that differ in one number each, for its
        derivatives."""
        return model if self._scene is None else self._scene.with_twins(model, bodies)
