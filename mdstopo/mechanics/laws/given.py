"""`table`: f is given over time, as a table whose present value the scene knows. No parameters."""

from mdstopo.case.arrays import Table
from mdstopo.case.laws import TableLaw
from mdstopo.compiler.jit import inline
from mdstopo.mechanics.laws.law_kernels import LawKernels


@inline
def given_force(value):
    """Force and its slopes by x and xd, energy and its slope by x: f, f_x, f_xd, V, V_x."""
    return value, 0.0, 0.0, 0.0, 0.0


def given_table(record: TableLaw) -> Table:
    """The table of the force over time."""
    return record.table


def given_breakpoints(record: TableLaw, _: bool) -> list[float]:
    """Times at which steps have to end: those of the table's rows."""
    times: list[float] = record.table.times.tolist()
    return times


KERNELS = LawKernels(force=given_force, signal=given_table, breakpoints=given_breakpoints)
