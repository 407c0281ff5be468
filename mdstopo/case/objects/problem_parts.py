"""Parts of the optimisation problem: responses, objectives, constraints, variables, and the settings of methods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np

from mdstopo.case.arrays import Components, FloatArray, FrozenDict, read_only
from mdstopo.case.methods.over_time import DEFAULT_REDUCTION
from mdstopo.case.value import Value, frozen
from mdstopo.settings.optimizer_presets import DEFAULT_OPTIMIZER


def _none() -> FloatArray:
    return np.zeros(0)


@frozen
class Response(Value):
    """A number of the state of motion, which is followed over time.

    kind: the word of its record (`case.responses.response_kinds`). Fields that a kind does not use are None.
    at_local is in body coordinates of `body`; component: x | y | norm, in space also z. numbers: up to four of
    its own for its kernels; of a tilt: its axis, a unit vector in body coordinates. dimension: of the
    case, whose responses have records of their own. since: of a displacement, the place that it counts from,
    stated | settled. Of an expression: formula, the responses that it is of, with their names in it, numbers that it
    has by name, and the unit that the case states.
    """

    kind: str
    body: str | None = None
    at_local: Components | None = None
    relative_to: str | None = None
    component: str | None = None
    group: str | None = None
    joint: str | None = None
    numbers: tuple[float, ...] = ()
    dimension: int = 2
    since: str | None = None
    formula: str = ""
    of: tuple[tuple[str, Response], ...] = ()
    parameters: tuple[tuple[str, float], ...] = ()
    unit: str = ""

    @property
    def parts(self) -> tuple[Response, ...]:
        """The responses of which this one is an expression; itself where it is none."""
        return tuple(each for _, each in self.of) or (self,)


@frozen
class Objective(Value):
    """What is to be improved. over_time: the name of a record of `methods.over_time`; sense: minimize | maximize."""

    name: str
    response: Response
    over_time: str = DEFAULT_REDUCTION
    load_case: str = "default"
    sense: str = "minimize"


@frozen
class Variable(Value):
    """A parameter of laws that the optimiser varies, a coordinate of points, or a defined name.

    groups: whose; laws: in each of them the place of the law. each: group | member | point | case; count: how many
    values it has, one or as many as a group has members or a grid points. initial, lower, upper in the parameter's
    unit; initial of points is an array (count,). cost: what one unit of each value adds to volume rows that cover any
    of the groups. points: the grid whose points' coordinates along one axis the values are; empty for a parameter.
    defined: the name in `define` whose number it is, which has no groups and laws of its own; reached: the groups in
    which something follows from it, moved: the grids of points whose places do.
    """

    name: str
    groups: tuple[str, ...]
    laws: tuple[int, ...]
    parameter: str
    each: str
    count: int
    initial: float | FloatArray
    lower: float
    upper: float
    cost: float = 0.0
    unit: str = ""
    points: str = ""
    defined: str = ""
    reached: tuple[str, ...] = ()
    moved: tuple[str, ...] = ()

    @property
    def initials(self) -> FloatArray:
        """(count,) the initial values of the variable."""
        return np.full(self.count, self.initial)

    @property
    def of(self) -> str:
        """What varies, in words: whose parameter, coordinate or name it is."""
        if self.defined:
            return f"define.{self.defined}"
        return f"points {self.points}" if self.points else f"{self.parameter} of {', '.join(self.groups)}"


@frozen
class Following(Value):
    """A number of the case that is an expression of defined names which are design variables.

    key: its key path; expression: as written. kind: law, a number of a law; points, of the places of points; scene, of
    masses, loads and velocities. group, law, parameter: of a law the group, its place there, and which number of it.
    grid: of points their name.
    """

    key: str
    expression: str
    kind: str
    group: str = ""
    law: int = 0
    parameter: str = ""
    grid: str = ""


@frozen
class Follows(Value):
    """What follows from defined names that are design variables.

    names: these, in the order of the variables. numbers: what follows from any of them, in the case's order. given:
    all other defined names that expressions of the numbers lead to, each a number or an expression.
    """

    names: tuple[str, ...]
    numbers: tuple[Following, ...]
    given: Mapping[str, float | str] = field(default_factory=FrozenDict)

    def of_kind(self, kind: str) -> tuple[Following, ...]:
        """The numbers of one kind: law, points or scene."""
        return tuple(each for each in self.numbers if each.kind == kind)


@frozen
class VolumeRow(Value):
    """A linear limit on material or cost (Eq. 14): coefficients (N,) . alpha <=, = or >= bound (``limit``,
    ``equals``, ``at_least``).

    A row that the case states as a fraction of the total is a limit here. prices (P,): coefficients of the values of
    variables, whose costs are added; empty where no variable has a cost.
    """

    groups: tuple[str, ...]
    coefficients: FloatArray
    bound: float
    sense: str
    prices: FloatArray = field(default_factory=_none)

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", read_only(self.coefficients))
        object.__setattr__(self, "prices", read_only(self.prices))

    def spent(self, design: FloatArray) -> float:
        """What a design costs: the sum over alpha (N,) and, behind it, the values of variables (P,)."""
        total = float(self.coefficients @ design[: len(self.coefficients)])
        return total + float(self.prices @ design[len(self.coefficients) :]) if len(self.prices) else total


@frozen
class ResponseRow(Value):
    """A response over time that is bounded: ``limit``, ``equals`` or ``at_least``."""

    response: Response
    over_time: str
    load_case: str
    bound: float
    sense: str


#: what is evaluated of a load case: a response with its reduction over time
ReducedResponse = Objective | ResponseRow


@frozen
class Combine(Value):
    """How several objectives become one; weights of every objective, in their order, of sum 1."""

    method: str
    weights: Mapping[str, float]
    exponent: float = 2.0
    normalize: bool = True


@frozen
class OptimizerSettings(Value):
    """The `optimizer` section; options: the optimiser's single settings that the file overrides."""

    name: str = DEFAULT_OPTIMIZER
    preset: str = "default"
    max_iterations: int = 200
    tolerance: float = 1e-6
    starts: int = 1
    seed: int = 0
    options: Mapping[str, float | bool | int] = field(default_factory=FrozenDict)


@frozen
class SolverSettings(Value):
    """The `solver` section; step in s or None where the file leaves it out."""

    integrator: str = "auto"
    tolerance: float = 1e-8
    sensitivity: str = "auto"
    assemble: bool = False
    step: float | None = None
    spectral_radius: float | None = None
    settle: bool = False
