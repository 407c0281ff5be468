"""What many rows cost: peaks, and members that compete, pulled back in one sweep; and what finding them costs."""

import time
from collections.abc import Callable, Iterator

import numpy as np

from mdstopo import load_case
from mdstopo.bench.tables import Table, significant
from mdstopo.case.reader import read_case
from mdstopo.engine import Evaluator
from mdstopo.evaluation import Rows
from mdstopo.general.driver import GeneralDriver
from mdstopo.general.extremes import FRACTION, STEP
from mdstopo.general.landings import INTEGRALS

ROWS = (1, 6, 30, 100)
CASES = ("restraint", "lander")
#: as many rows of each response as there are, from however far below the highest
EVERY = Rows(window=1.0, most=100)

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
    """Two tables: the sweep alone, and whole evaluations of the wires."""
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


def _sweeps(evaluator: Evaluator, load_case: str) -> list[str]:
    """Members, steps, ms of one row, and how many times that so many rows take."""
    evaluator.evaluate(evaluator.case.start, rows=EVERY)
    driver = evaluator.driver(load_case)
    assert isinstance(driver, GeneralDriver)
    _, count, _ = driver.run(evaluator.design(evaluator.case.start), True, driver.landings)
    known = [
        (j, *driver.rows[j, r])
        for j, reduction in enumerate(driver.scene.reductions)
        if reduction not in INTEGRALS
        for r in range(int(driver.found[j]))
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
    return lambda: driver.entry.pull_rows(
        *driver.steps_arguments(count), which, table, driver.room, driver.room_ints, driver.strength, padded, out,
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
