"""What many rows cost: peaks, and members that compete, pulled back in one sweep; what finding them costs; and what an
iteration of the optimiser costs where very many members keep limits on responses."""

import time
from collections.abc import Callable, Iterator
from statistics import median

import numpy as np

from mdstopo import load_case
from mdstopo.bench.scaling import whole_run
from mdstopo.bench.scenes import plate
from mdstopo.bench.tables import Table, significant, verdict
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.evaluation import Rows
from mdstopo.general.driver.general_driver import GeneralDriver
from mdstopo.general.responses.extremes import FRACTION, STEP
from mdstopo.optimizer.problem import Floats, Problem, Sample
from mdstopo.starts.single_start import make_optimizer

ROWS = (1, 6, 30, 100)
CASES = ("restraint", "lander")
#: as many rows of each response as there are, from however far below the highest
EVERY = Rows(window=1.0, most=100)

#: members of the scene with two limits, iterations that are timed after the first, and those of a whole run
MANY, TIMED, WHOLE = (10_000, 100_000, 1_000_000), 8, 5
#: most that an iteration may take, in evaluations, from so many members on
MOST, FROM = 1.25, 90_000
LIMITS = """\
  - {response: {displacement: {body: torso}}, over_time: max, limit: 0.14}
  - {response: {acceleration: {body: torso}}, over_time: max, limit: 60}
"""

WIRES = """
format: 1
time: {end: 2}
gravity: [0, -3]
bodies: {plate: {mass: 2, inertia: 0.4, position: [0.02, 1], velocity: [0.05, -1], angular_velocity: 0.06}}
points:
  base: {body: ground, grid: {line: {from: [-1, 0], to: [1, 0], count: 200}}}
  edge: {body: plate, grid: {line: {from: [-0.97, 0.8], to: [1.03, 0.8], count: 200}}}
members:
  wires: {from: base, to: edge, connect: pairs, law: {type: spring, stiffness: 2, damping: 0.02}}
design: {initial: 0.7}
objectives: {F: {response: {member_force: {group: wires}}, over_time: max}}
solver: {tolerance: 1.0e-6}
"""


def rows() -> Iterator[Table]:
    """Three tables: the sweep alone, whole evaluations of the wires, and very many members with two limits."""
    wires = Evaluator(read_case(WIRES))
    lines = [["200 wires on one body", *_sweeps(wires, "default")]]
    for name in CASES:
        evaluator = Evaluator(load_case(f"cases/{name}.yaml"))
        for load_case_name in evaluator.scenes:
            driver = evaluator.driver(load_case_name)
            if isinstance(driver, GeneralDriver) and len(driver.scene.responses):
                lines.append([f"{name}, {load_case_name}", *_sweeps(evaluator, load_case_name)])
    yield Table(
        "Rows pulled back in one sweep: CPU time in times of one row",
        ["scene", "members", "steps", "one row, ms", *(f"{n} rows" for n in ROWS[1:]), f"{ROWS[-1]} one by one"],
        lines,
        ["Rows are those that the scene has, again from the first where it has fewer; each begins at its own peak."],
    )
    found = []
    for count in ROWS:
        asked = Rows(window=1.0, most=count)
        values = _seconds(lambda asked=asked: wires.evaluate(wires.case.start, False, rows=asked))  # type: ignore[misc]
        whole = _seconds(lambda asked=asked: wires.evaluate(wires.case.start, rows=asked))  # type: ignore[misc]
        found.append([str(count), significant(1e3 * values), significant(1e3 * whole)])
    yield Table(
        "200 wires that compete: CPU time of an evaluation, ms",
        ["rows", "simulated, rows found", "with gradients"],
        found,
    )
    limited = [_limited(members) for members in MANY]
    worst = max(iteration for members, iteration, _ in limited if members >= FROM)
    yield Table(
        "Very many members with two limits on responses: CPU time, ms",
        ["members", "objective", "rows", "all rows", "in objectives", "iteration", "in evaluations", "KKT residual",
         "run, s", "peak, MB", "file, MB"],
        [cells for *_, cells in limited],
        ["Objective: energy and gradient, without limits. All rows: with the gradients of both limits' peaks. Each "
         f"the median of {TIMED} designs of a run; an iteration is such an evaluation and the next design.",
         f"A run is `mdstopo run` with {WHOLE} iterations in a process of its own, from YAML to HDF5.",
         f"An iteration takes at most {MOST:g} evaluations from 1e5 members on: {verdict(worst <= MOST)}."],
    )  # fmt: skip


def _limited(members: int) -> tuple[int, float, list[str]]:
    """Members, an iteration in evaluations, and the row of the table."""
    text = plate(members)
    alone = Evaluator(read_case(text))
    evaluator = Evaluator(read_case(text + LIMITS))
    timed = _Timed(evaluator.problem())
    optimizer = make_optimizer(evaluator.case, timed)
    state = optimizer.step(optimizer.start())
    iterations, evaluations, objectives, count = [], [], [], []
    alone.evaluate(alone.case.start)
    for _ in range(TIMED):
        if not state.running:
            break
        design = state.trial
        began = time.process_time()
        alone.evaluate(design)
        objectives.append(time.process_time() - began)
        began = time.process_time()
        state = optimizer.step(state)
        iterations.append(time.process_time() - began)
        evaluations.append(timed.seconds)
        count.append(timed.rows)
    seconds, peak, file = whole_run(text + LIMITS, WHOLE)
    objective, evaluation, iteration = (median(each) for each in (objectives, evaluations, iterations))
    cells = [
        f"{evaluator.case.n_design:,}", significant(1e3 * objective), f"{median(count):.0f}",
        significant(1e3 * evaluation), f"{evaluation / objective:.1f}", significant(1e3 * iteration),
        f"{iteration / evaluation:.2f}", f"{state.kkt:.0e}", significant(seconds), f"{peak / 1e6:.0f}",
        f"{file / 1e6:.0f}",
    ]  # fmt: skip
    return evaluator.case.n_design, iteration / evaluation, cells


class _Timed:
    """A problem that keeps the CPU time of its last evaluation and its number of rows."""

    def __init__(self, problem: Problem) -> None:
        self.initial, self.linear = problem.initial, problem.linear
        self.lower, self.upper = problem.lower, problem.upper
        self.competes = True
        self._problem = problem
        self.seconds, self.rows = 0.0, 0

    def evaluate(self, x: Floats, gradient: bool = True) -> Sample:
        """The problem's sample."""
        began = time.process_time()
        sample = self._problem.evaluate(x, gradient)
        self.seconds = time.process_time() - began
        self.rows = len(sample.rows) + len(sample.constraint_rows)
        return sample


def _sweeps(evaluator: Evaluator, load_case: str) -> list[str]:
    """Members, steps, ms of one row, and how many times that so many rows take."""
    evaluator.evaluate(evaluator.case.start, rows=EVERY)
    driver = evaluator.driver(load_case)
    assert isinstance(driver, GeneralDriver)
    _, count, _ = driver.run(evaluator.design(evaluator.case.start), True, driver.quadrature_breakpoints)
    known = [
        (j, *driver.rows[j, r])
        for j, reduction in enumerate(driver.scene.reductions)
        if not reduction.is_integral
        for r in range(int(driver.row_counts[j]))
    ]
    times = [_seconds(_sweep(driver, count, known, rows)) for rows in ROWS]
    alone = [_sweep(driver, count, known[i % len(known) :], 1) for i in range(ROWS[-1])]
    times.append(_seconds(lambda: [each() for each in alone]))
    ratios = [f"{each / times[0]:.1f}" for each in times[1:]]
    return [str(evaluator.case.n_design), str(count), significant(1e3 * times[0]), *ratios]


def _sweep(driver: GeneralDriver, count: int, known: list[tuple[float, ...]], rows: int) -> Callable[[], object]:
    """The sweep of so many rows, prepared."""
    chosen = [known[i % len(known)] for i in range(rows)]
    chosen.sort(key=lambda row: (-row[1 + STEP], -row[1 + FRACTION]))
    which = np.array([(int(row[0]), 0) for row in chosen])
    table = np.array([row[1:] for row in chosen])
    padded, out = np.zeros((rows, len(driver.padded))), np.zeros((rows, driver.gradients.shape[2]))
    return lambda: driver.entry.rows_vjp(
        *driver.steps_arguments(count), which, table, driver.room, driver.room_ints, driver.member_state, padded, out,
        np.zeros((rows, 0)), driver.work,
    )  # fmt: skip


def _seconds(call: Callable[[], object]) -> float:
    """The least CPU time of several calls, s."""
    call()
    times: list[float] = []
    end = time.process_time() + 1.0
    while len(times) < 3 or time.process_time() < end:
        began = time.process_time()
        call()
        times.append(time.process_time() - began)
    return min(times)
