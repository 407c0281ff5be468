"""Stand-ins: a case made by hand and an engine without mechanics."""

import hashlib
import os
import signal
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mdstopo.case.model import (
    Body,
    Case,
    LoadCase,
    Marks,
    MemberGroup,
    Objective,
    OptimizerSettings,
    Response,
    SolverSettings,
    SpringLaw,
    VolumeRow,
)
from mdstopo.optimizer.problem import LinearRows, Sample
from mdstopo.status import Status

Floats = NDArray[np.float64]


def hand_made_case(**changes: Any) -> Case:
    """Two bodies, six design members in one group and two ordinary springs in another."""
    text = "format: 1\ntitle: Prüfstück\n"
    torso, vehicle = Body("torso", 60.0, 10.0, (0.0, 0.0)), Body("vehicle", 2000.0, 6000.0, (0.0, -1.0))
    p = np.array([[-0.25, -0.25], [0.25, -0.25]])
    q = np.array([[-1.0, -1.0], [0.0, -1.0], [1.0, -1.0]])
    belts = MemberGroup(
        name="belts",
        body_from="torso",
        body_to="vehicle",
        from_local=p,
        to_local=q - np.array([0.0, -1.0]),
        from_world=p,
        to_world=q,
        from_index=np.repeat([0, 1], 3),
        to_index=np.tile([0, 1, 2], 2),
        length=np.full(6, 0.9),
        laws=(SpringLaw(stiffness=225.0),),
        cost=np.ones(6),
    )
    straps = replace(
        belts,
        name="gürtel",
        body_to="ground",
        to_local=q,
        from_index=np.array([0, 1]),
        to_index=np.array([0, 1]),
        length=np.full(2, 1.1),
        cost=np.zeros(2),
        design=False,
    )
    case = Case(
        title="Prüfstück",
        path=None,
        name="probe",
        text=text,
        sha256=hashlib.sha256(text.encode()).hexdigest(),
        overrides={},
        files={"pulses/p.csv": "ab" * 32},
        bodies=(torso, vehicle),
        joints=(),
        bushings=(),
        points={},
        members=(belts, straps),
        load_cases=(LoadCase("default", (0.0, -9.8), 0.0, 0.2, (), (), (torso, vehicle)),),
        objectives=(Objective("G", Response("energy")),),
        combine=None,
        constraints=(VolumeRow(("belts",), np.ones(6), 0.6, "equals"),),
        optimizer=OptimizerSettings(),
        solver=SolverSettings(),
        marks=Marks({}),
    )
    return replace(case, **changes)


def limited(case: Case, iterations: int, **optimizer: Any) -> Case:
    """The case with an iteration limit and steps so small that only the limit ends the run."""
    changes = {
        "tolerance": 0.0,
        "max_iterations": iterations,
        "options": {"move_limit": 1e-4, "decrease_tolerance": 0.0},
    }
    return replace(case, optimizer=replace(case.optimizer, **(changes | optimizer)))


@dataclass
class FakePeak:
    time: float
    value: float


@dataclass
class FakeEvaluation:
    objectives: dict[str, float]
    gradients: dict[str, Floats]
    peaks: dict[str, tuple[FakePeak, ...]]
    status: Status = Status.OK
    constraints: Floats = field(default_factory=lambda: np.zeros(1))


@dataclass
class FakeMotion:
    t: Floats
    q: Floats
    v: Floats
    a: Floats
    lam: Floats
    status: Status = Status.OK
    reactions: dict[str, Floats] = field(default_factory=dict)


class FakeEngine:
    """Two competing smooth rows; `delay` seconds an evaluation; fails from the `fail_from`-th on."""

    integrator = "gauss"
    integrator_reason = "made up"
    sensitivity = "adjoint"

    def __init__(self, case: Case, delay: float = 0.0, fail_from: int = 10**9) -> None:
        self.case = case
        self.delay = delay
        self.fail_from = fail_from
        self.count = 0
        rng = np.random.default_rng(3)
        self.weights = rng.uniform(0.5, 5.0, (2, case.n_design))
        self.powers = rng.uniform(0.5, 2.0, (2, case.n_design))

    def problem(self) -> "FakeEngine":
        return self

    @property
    def initial(self) -> Floats:
        return self.case.initial

    @property
    def lower(self) -> Floats:
        return self.case.lower

    @property
    def upper(self) -> Floats:
        return self.case.upper

    @property
    def linear(self) -> LinearRows:
        rows = [row for row in self.case.constraints if isinstance(row, VolumeRow)]
        return LinearRows(
            np.array([row.coefficients for row in rows]),
            np.array([row.bound for row in rows]),
            np.array([row.sense == "equals" for row in rows]),
        )

    def rows(self, x: Floats) -> tuple[Floats, Floats]:
        values = (self.weights * (x + 0.05) ** -self.powers).sum(axis=1)
        slopes = -self.weights * self.powers * (x + 0.05) ** (-self.powers - 1.0)
        order = np.argsort(-values, kind="stable")
        return values[order], slopes[order]

    def sample(self, x: Floats) -> Sample:
        values, slopes = self.rows(x)
        info = {"objectives": values[:1], "peak_time": np.array([0.1])}
        return Sample(float(values[0]), values, slopes, np.zeros(0), np.zeros((0, len(x))), info=info)

    def evaluate(self, x: Floats, gradient: bool = True) -> Any:
        if self.delay:
            time.sleep(self.delay)
        self.count += 1
        if self.count >= self.fail_from:
            return Sample(float("nan"), status=Status.NON_FINITE)
        return self.sample(x)

    def trajectory(self, alpha: Floats, load_case: str) -> FakeMotion:
        t = np.linspace(0.0, 0.2, 5)
        q = np.outer(t, np.ones(6)) * np.array([1.0, 0.0, 0.0, 0.0, -1.0, 0.0]) / alpha.sum()
        return FakeMotion(t, q, q, q, np.zeros((5, 0)))


class FakeEngineWithEvaluations(FakeEngine):
    """The engine and its problem apart, as the real ones are."""

    def problem(self) -> FakeEngine:
        return FakeEngine(self.case, self.delay, self.fail_from)

    def evaluate(self, x: Floats, gradient: bool = True) -> FakeEvaluation:
        values, slopes = self.rows(x)
        peaks = tuple(FakePeak(0.1 * (i + 1), float(value)) for i, value in enumerate(values))
        return FakeEvaluation({"G": float(values[0])}, {"G": slopes[0]}, {"G": peaks})


class DyingEngine(FakeEngineWithEvaluations):
    """Kills a worker that uses it, a second after the first evaluation: before it is decided which starts go on."""

    def problem(self) -> FakeEngine:
        return _Dying(self.case, 0.2, 2)


class _Dying(FakeEngine):
    def evaluate(self, x: Floats, gradient: bool = True) -> Any:
        if self.count + 1 >= self.fail_from:
            time.sleep(1.0)
            os.kill(os.getpid(), signal.SIGKILL)
        return super().evaluate(x, gradient)


class DyingOnceEngine(FakeEngineWithEvaluations):
    """Kills the first worker that has used it for a while; `mark` is a file that says that one is dead."""

    def __init__(self, case: Case, mark: str) -> None:
        super().__init__(case, 0.4)
        self.mark = mark

    def problem(self) -> FakeEngine:
        return _DyingOnce(self.case, self.mark)


class _DyingOnce(FakeEngine):
    def __init__(self, case: Case, mark: str) -> None:
        super().__init__(case, 0.4)
        self.mark = mark

    def evaluate(self, x: Floats, gradient: bool = True) -> Any:
        if self.count == 2:
            with suppress(FileExistsError):
                os.close(os.open(self.mark, os.O_CREAT | os.O_EXCL))
                os.kill(os.getpid(), signal.SIGKILL)
        return super().evaluate(x, gradient)
