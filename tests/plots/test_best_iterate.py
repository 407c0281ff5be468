"""Which iterate of a file tables and comparisons of results are about."""

from pathlib import Path

import pytest

from mdstopo.case.reader import read_case
from mdstopo.plots.source import Source
from mdstopo.report.report_tables import best_iterate, constraint_rows, objective_rows
from mdstopo.session.run_session import run_session
from mdstopo.status import RunStatus

#: two springs that cannot keep both limits
TOO_TIGHT = """
format: 1
time: {end: 1}
bodies: {a: {mass: 1, inertia: 1, position: [0, 0]}}
members:
  x: {from: {body: ground, at: [-5, 0]}, to: {body: a, at: [0, 0]}, law: {type: spring, stiffness: 40, damping: 2}}
  y: {from: {body: ground, at: [0, -5]}, to: {body: a, at: [0, 0]}, law: {type: spring, stiffness: 40, damping: 2}}
loads: [{body: a, force: [4, 0.5]}]
design: {initial: 0.5, lower: 0.01}
objectives: {X: {response: {displacement: {body: a, component: x}}, over_time: max}}
constraints:
  - {response: {displacement: {body: a, component: y}}, over_time: max, limit: 0.005}
  - {response: {displacement: {body: a}}, over_time: max, limit: 0.1}
solver: {tolerance: 1e-8}
"""


def test_where_no_design_keeps_the_limits_tables_are_of_the_design_in_the_file(tmp_path: Path) -> None:
    """They were of the last iterate, which may be a design far off that was tried."""
    outcome = run_session(read_case(TOO_TIGHT), path=tmp_path / "tight.h5")
    assert outcome.status is RunStatus.FAILED
    source = Source(tmp_path / "tight.h5")
    assert best_iterate(source) != len(source.view.array("iterations/combined")) - 1
    assert objective_rows(source)[0]["best"] == outcome.objectives["X"]
    over = [row["best"] - row["bound"] for row in constraint_rows(source)]
    assert over == pytest.approx(outcome.constraints.tolist(), rel=1e-12)
