"""What a method of integration does for those who look at its steps, chosen by its tag when a kernel is compiled.

The tag is a tuple of zeros whose length says which method is meant.

1. `point_of(tag, model, tables, strength, track, count, k, c, keep, desk, q, v, work) -> w`: the state at fraction c of
   step k, inside it; with `keep` as an end from which the reverse sweep can start: of step w.
2. `step_back(tag, model, tables, track, w, c, lam_q, lam_v, lam_x, bars, rows_bar, z, y, desk, work)`: R cotangents
   lam_q, lam_v (R, n) of the end of step w (each of its fraction c (R,) where that is below 1) pulled back to its
   start, in place, with explicit ones of the stages, which are the same for all; z (R, s, n) are the virtual
   displacements of the stages' balances. lam_x (R, 2, n): what a method carries from step to step beside the state.
   What a stage needs is formed once for all R.
3. `step_forward(tag, model, tables, track, w, c, sweeps, dq, dv, dx, force, changes, rows, desk)`: changes pushed
   through step w, by fixed-point sweeps where sweeps > 0 (returns whether they settled), with forces (s, n) on its
   stages; changes (s, 3, n) and rows (s, n_row) of the stages come out.
4. `beside(tag, track, k, c, e, q, v, a, q_out, v_out)`: the motion a little later (e < 0: earlier) than at fraction c
   of step k, where it is q, v, a; `derivatives(tag)`: how many derivatives of the motion are those of the balance.
5. `weights_of(tag, model, tables, track, w, out)`: weights (s,) of the stages in the integral over step w.
"""

from collections.abc import Callable
from typing import Any

from mdstopo.compiler.jit import by_type

DUTIES: dict[str, dict[int, Any]] = {
    "point_of": {},
    "step_back": {},
    "step_forward": {},
    "beside": {},
    "derivatives": {},
    "weights_of": {},
}


def point_of(tag, model, tables, strength, track, count, k, c, keep, desk, q, v, work):
    """Duty 1."""
    raise NotImplementedError


def step_back(tag, model, tables, track, w, c, lam_q, lam_v, lam_x, bars, rows_bar, z, y, desk, work):
    """Duty 2."""
    raise NotImplementedError


def step_forward(tag, model, tables, track, w, c, sweeps, dq, dv, dx, force, changes, rows, desk):
    """Duty 3."""
    raise NotImplementedError


def beside(tag, track, k, c, e, q, v, a, q_out, v_out):
    """Duty 4."""
    raise NotImplementedError


def derivatives(tag):
    """Duty 4."""
    raise NotImplementedError


def weights_of(tag, model, tables, track, w, out):
    """Duty 5."""
    raise NotImplementedError


def implement(tag: tuple[int, ...], **duties: Callable[..., Any]) -> None:
    """Enter a method's compiled functions."""
    for name, function in duties.items():
        DUTIES[name][len(tag)] = function


def _of(name: str, tag: Any) -> Any:
    return DUTIES[name][len(tag)]


@by_type(point_of)
def _point_of(tag, model, tables, strength, track, count, k, c, keep, desk, q, v, work):
    return _of("point_of", tag)


@by_type(step_back)
def _step_back(tag, model, tables, track, w, c, lam_q, lam_v, lam_x, bars, rows_bar, z, y, desk, work):
    return _of("step_back", tag)


@by_type(step_forward)
def _step_forward(tag, model, tables, track, w, c, sweeps, dq, dv, dx, force, changes, rows, desk):
    return _of("step_forward", tag)


@by_type(beside)
def _beside(tag, track, k, c, e, q, v, a, q_out, v_out):
    return _of("beside", tag)


@by_type(derivatives)
def _derivatives(tag):
    return _of("derivatives", tag)


@by_type(weights_of)
def _weights_of(tag, model, tables, track, w, out):
    return _of("weights_of", tag)
