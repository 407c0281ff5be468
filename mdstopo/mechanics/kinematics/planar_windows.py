"""Windows of collocation in a plane: coordinates since the start of a window are added to it as numbers."""

from mdstopo.compiler.jit import part

#: freedoms of a body
FREEDOMS = 3


@part
def _moving(model):
    """Freedoms of bodies that are no ground."""
    return FREEDOMS * (model.home.shape[0] - 1)


@part
def window_state(model, q0, x, y, q, v):
    """Coordinates and velocities; see `kinematics_interface.window_state`."""
    for d in range(_moving(model)):
        q[d] = q0[d] + x[d]
        v[d] = y[d]


@part
def window_accelerations(model, x, y, u, a):
    """The same numbers; see `kinematics_interface.window_accelerations`."""
    for d in range(_moving(model)):
        a[d] = u[d]


@part
def window_rates(model, x, y, a, u):
    """The same numbers; see `kinematics_interface.window_rates`."""
    for d in range(_moving(model)):
        u[d] = a[d]


@part
def window_size(model):
    """Nothing comes in between."""
    return 0


@part
def window_maps(model, x, y, u, maps):
    """Nothing comes in between; see `kinematics_interface.window_maps`."""


@part
def window_rates_with_maps(model, x, y, a, u, maps):
    """The same numbers; see `kinematics_interface.window_rates_with_maps`."""
    window_rates(model, x, y, a, u)


@part
def window_jvp(model, maps, dx, dy, dq, dv, da):
    """Changes forward; see `kinematics_interface.window_jvp`."""
    for d in range(_moving(model)):
        dq[d] = dx[d]
        dv[d] = dy[d]
        da[d] = 0.0


@part
def window_vjp(model, maps, bar_q, bar_v, bar_a, bar_x, bar_y):
    """Cotangents back; see `kinematics_interface.window_vjp`."""
    for d in range(_moving(model)):
        bar_x[d] = bar_q[d]
        bar_y[d] = bar_v[d]


@part
def window_turn(model, maps, inverse, transposed, x):
    """Nothing changes; see `kinematics_interface.window_turn`."""


@part
def window_start_jvp(model, x, dq0, dq):
    """See `kinematics_interface.window_start_jvp`."""
    for d in range(_moving(model)):
        dq[d] += dq0[d]


@part
def window_start_vjp(model, x, bar_q, bar_q0):
    """See `kinematics_interface.window_start_vjp`."""
    for d in range(_moving(model)):
        bar_q0[d] += bar_q[d]


@part
def window_slopes(model, maps, coupled, by_x, by_y):
    """Nothing changes; see `kinematics_interface.window_slopes`."""
