"""Coefficients of the explicit methods in one form, for q'' = a(q, v, t):

    Q_i = q_0 + h c_i v_0 + h^2 sum_j AA_ij a_j      V_i = v_0 + h sum_j A_ij a_j
    q_1 = q_0 + h v_0 + h^2 sum_j bb_j a_j           v_1 = v_0 + h sum_j b_j a_j

Where nothing depends on velocity and nothing switches: the Nystroem pair 12(10), 17 stages, whose stages have no
velocities (A = 0). Else: Dormand-Prince 8(5,3), 12 stages, a Runge-Kutta method written in this form (AA = A A,
bb = b A). Its polynomial of order 7 between both ends of a step needs one stage at the end and three more, 16 in all:

    y(c) = y_0 + h sum_j b_j(c) y'_j
    b(c) = c (b + d (e - b + c (2 b - e - f + d (D_0 + c (D_1 + d (D_2 + c D_3))))))

d = 1 - c, with e and f the first stage and the one at the end, and D_0 to D_3 rows of the table.
"""

import json
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from mdstopo.scene.springs_model import FloatArray

STAGES = (17, 12)
ORDERS = (12, 8)
NYSTROEM, GENERAL = 0, 1
#: stages of the second method with those that its polynomial between both ends of a step needs
INSIDE = 16
#: planes of a method's table (s_max, s_max): AA, A, and rows of VECTORS: c, bb, b, weights of the error estimates for
#: q and v, and of a second, coarser pair of estimates (zero for the Nystroem pair); the four rows D (zero for it, too)
AA, A, VECTORS = range(3)
C, BB, B, E_Q, E_V, E2_Q, E2_V, D = range(8)


def _lower(entries: dict[str, str], stages: int) -> FloatArray:
    matrix = np.zeros((stages, stages))
    for key, value in entries.items():
        row, column = (int(part) for part in key.split(","))
        matrix[row - 1, column - 1] = float(value)
    return matrix


def _numbers(values: list[str]) -> FloatArray:
    return np.array([float(value) for value in values])


def _add_inside(given: dict[str, Any], out: FloatArray) -> None:
    """What the polynomial between both ends of a step needs: further stages, and the rows D."""
    s, inside = STAGES[GENERAL], given["inside"]
    whole = _lower(given["a"] | inside["a"], INSIDE)
    whole[s, :s] = _numbers(given["b"])
    out[A, :INSIDE, :INSIDE], out[AA, :INSIDE, :INSIDE] = whole, whole @ whole
    out[VECTORS, C, s], out[VECTORS, C, s + 1 : INSIDE] = 1.0, _numbers(inside["c"])
    for row, values in enumerate(inside["d"]):
        for stage, value in values.items():
            out[VECTORS, D + row, int(stage) - 1] = float(value)


@cache
def runge_kutta_tables() -> FloatArray:
    """Both methods, (2, 3, 17, 17), padded with zeros; not to be written to (see `gauss_tables` on the flag)."""
    data: dict[str, dict[str, Any]] = json.loads(
        files("mdstopo.integrators").joinpath("runge_kutta.json").read_text(encoding="utf-8")
    )
    tables = np.zeros((2, 3, max(STAGES), max(STAGES)))
    given = data["nystroem"]
    out, s = tables[NYSTROEM], STAGES[NYSTROEM]
    out[AA, :s, :s] = _lower(given["a"], s)
    for row, key in ((C, "c"), (BB, "b"), (B, "b_velocity"), (E_Q, "b_minus_bhat"), (E_V, "b_velocity_minus_bhat")):
        out[VECTORS, row, :s] = _numbers(given[key])
    given = data["general"]
    out, s = tables[GENERAL], STAGES[GENERAL]
    matrix = _lower(given["a"], s)
    _add_inside(given, out)
    out[A, :s, :s], out[AA, :s, :s] = matrix, matrix @ matrix
    for row, values in ((BB, _numbers(given["b"]) @ matrix), (C, _numbers(given["c"])), (B, _numbers(given["b"]))):
        out[VECTORS, row, :s] = values
    for position, velocity, key in ((E_Q, E_V, "e5"), (E2_Q, E2_V, "e3")):
        weights = _numbers(given[key])
        out[VECTORS, position, :s], out[VECTORS, velocity, :s] = weights @ matrix, weights
    return tables
