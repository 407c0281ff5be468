"""Masses, loads and velocities at the start that follow from defined names, in the arrays of a general scene.

The case is read once more at other numbers, but for what has nothing to do with them. Its arrays take the place of the
scene's own (`BALANCE`); those with each name a little larger and smaller stand beside it as `GeneralModel.twins`, of
which kernels make derivatives (`balance_slopes`).
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from mdstopo.case.design.following import expressions_of
from mdstopo.case.model import GROUND, Case, LoadCase
from mdstopo.case.text.errors import CaseError
from mdstopo.general.model.general_model import VARIED_COLUMNS, GeneralModel, pack_general
from mdstopo.general.scene.dimension import dimension_of
from mdstopo.general.scene.further_times import landed
from mdstopo.general.scene.layout import arrange
from mdstopo.general.scene.moved_ends import WIDTH
from mdstopo.mechanics.kinematics.kinematics_interface import Kinematics
from mdstopo.scene.design_map import BESIDE_SCENE, CasesWith
from mdstopo.scene.springs_model import FloatArray, IndexArray

#: the arrays of a scene that may follow from names, besides places of members and numbers of laws
BALANCE = ("mass", "v0", "force", "load_body", "load_follows", "load_arm", "load_force", "schur_constant")
#: how far names are shifted, relative to their size, and how large they are at least, as a share of their range
SHIFT, LEAST_SIZE = 1e-4, 3e-3
#: arrays that are seen from the principal axes of bodies. Those of an inertia that is scaled as a whole stay, but for
#: rounding, relative to the largest number
TURNED = ("home", "member", "joint_par", "response_par", "contact", "bushing")
ROUNDED = 1e-11
ALLOWED = "masses, inertias, gravity, loads over given times, and velocities at the start"


class NumbersOfScene:
    """The numbers of one load case, beside those of laws and points, that follow from design variables which are
    defined names."""

    def __init__(self, case: Case, load_case: LoadCase, model: GeneralModel) -> None:
        assert case.follows is not None
        self._case, self._load_case, self._model = case, load_case, model
        self._numbers = case.follows.numbers
        self._expressions = expressions_of(case.follows, self._numbers)
        self._there = CasesWith(case, self._numbers, BESIDE_SCENE)
        #: how many names there are
        self.count = len(case.follows.names)
        self._least = [LEAST_SIZE * (each.upper - each.lower) for each in case.defined_variables]
        self._twins: list[tuple[GeneralModel, GeneralModel]] = []
        self._apart = np.zeros(0)

    def at(self, model: GeneralModel, x: FloatArray) -> GeneralModel:
        """The arrays with the names (B,) at x; in the segments that the scene was compiled with."""
        values, tangents = self._expressions.values(x), self._expressions.slopes(x)
        shifts = SHIFT * np.maximum(np.abs(x), self._least)
        self._apart = 2.0 * shifts
        self._twins = [(self._twin(values + way), self._twin(values - way)) for way in (shifts * tangents).T]
        return model._replace(**self._arrays(values))

    def with_twins(self, model: GeneralModel, bodies: Kinematics) -> GeneralModel:
        """The arrays with the scenes that differ in one name each, at the values that were put in last, in the same
        segments."""
        if not self._twins:
            return model
        packed = [[pack_general(landed(each, model.times.tolist()), bodies) for each in pair] for pair in self._twins]
        twins = np.array([[floats for _, floats in pair] for pair in packed])
        return model._replace(apart=self._apart, twins=twins, twin_ints=packed[0][0][0].ravel())

    def _twin(self, values: FloatArray) -> GeneralModel:
        """The arrays with values (K,) of what follows, without members and responses."""
        model = self._model
        segments = len(model.times) - 1
        shapes = {
            "level": (segments, 0, 2), "active": (segments, 0), "block": (0, model.block.shape[1]),
            "law": (0, model.law.shape[1]), "power": (0,), "member": (len(model.member), 0), "curves": (0,),
            "varied": (0, VARIED_COLUMNS), "along": (0, WIDTH), "response": (0, model.response.shape[1]),
            "response_par": (0, model.response_par.shape[1]),
        }  # fmt: skip
        nothing = {name: np.zeros(shape, getattr(model, name).dtype) for name, shape in shapes.items()}
        return model._replace(**nothing, **self._arrays(values))

    def _arrays(self, values: FloatArray) -> dict[str, Any]:
        """The arrays `BALANCE` with values (K,) of what follows."""
        case, model, dimension = self._case, self._model, dimension_of(self._case)
        load_case = self._there.at(values).load_case(self._load_case.name)
        mass, v0 = model.mass.copy(), model.v0.copy()
        bodies = dimension.kinematics
        for i, body in enumerate(load_case.bodies):
            own = slice(bodies.freedoms * i, bodies.freedoms * (i + 1))
            mass[own], v0[own] = dimension.masses(body), dimension.velocities(body, model.home[i])
        index = {name: i for i, name in enumerate([*(body.name for body in load_case.bodies), GROUND])}
        loads = dimension.loads(load_case, index, model.times, dimension.frames(load_case), True)
        schur_constant = model.schur_constant
        if len(model.joint) and not np.array_equal(mass, model.mass):
            fixed = [dimension.joint_kernels(type(each)).steady for each in case.joints]
            layout = arrange(
                case, model.joint, model.joint_par, fixed, model.free, mass, model.home, model.pair, bodies
            )
            schur_constant = layout.schur_constant
        return {
            "mass": mass, "v0": v0, "force": loads.force, "load_body": loads.load_body,
            "load_follows": loads.load_follows, "load_arm": loads.load_arm, "load_force": loads.load_force,
            "schur_constant": schur_constant,
        }  # fmt: skip


def refuse_other_places(case: Case, compiled: Callable[[Case, LoadCase], GeneralModel]) -> None:
    """Refuse names from which more of a scene follows than what it is differentiated by (CaseError).

    compiled: makes the arrays of a load case.
    """
    follows = case.follows
    assert follows is not None
    expressions = expressions_of(follows, follows.numbers)
    start = np.concatenate([each.initials for each in case.defined_variables])
    values = expressions.values(start)
    unchanged = [name for name in GeneralModel._fields if name not in BALANCE]
    for key in ("settle", "assemble"):
        if getattr(case.solver, key):
            _refuse(case, expressions.depends(0)[0], f"{follows.numbers[0].key}, which does not go with solver.{key}")
    cases = CasesWith(case, follows.numbers, ("uncertainty", "fit"))
    # read anew, too: the case may have its points where a design has them
    plain = _plain(cases.at(values))
    before = {each.name: compiled(plain, each) for each in plain.load_cases}

    def moves_more(which: IndexArray) -> bool:
        shifted = values.copy()
        shifted[which] += SHIFT * np.where(values[which] == 0.0, 1.0, np.abs(values[which]))
        there = _plain(cases.at(shifted))
        turned = TURNED if all(".inertia" in follows.numbers[k].key for k in which.tolist()) else ()
        for load_case in there.load_cases:
            one, other = before[load_case.name], compiled(there, load_case)
            if any(_differ(getattr(one, name), getattr(other, name), name in turned) for name in unchanged):
                return True
        return False

    if not moves_more(np.arange(len(values))):
        return
    for k, number in enumerate(follows.numbers):
        if moves_more(np.array([k])):
            _refuse(case, expressions.depends(k)[0], f"{number.key}, which changes more of the scene than {ALLOWED}")


def _plain(case: Case) -> Case:
    return replace(case, variables=(), movable=(), follows=None)


def _differ(one: Any, other: Any, turned: bool) -> bool:
    """Whether two arrays of a scene differ; turned: by more than rounding has left of axes."""
    if one.shape != other.shape or not turned:
        return not np.array_equal(one, other)
    return bool(np.abs(one - other).max(initial=0.0) > ROUNDED * np.abs(one).max(initial=0.0))


def _refuse(case: Case, word: str, message: str) -> None:
    name = next(each.name for each in case.variables if each.defined == word)
    words = f"from define.{word} follows {message}"
    raise CaseError([case.marks.mistake(f"design.variables.{name}.of", words)], str(case.path or case.name))
