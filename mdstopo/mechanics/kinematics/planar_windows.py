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
    """Coordinates and velocities inside a window; see `kinematics_interface.window_state`."""
    for d in range(_moving(model)):
        q[d] = q0[d] + x[d]
        v[d] = y[d]


@part
def window_accelerations(model, x, y, u, a):
    """Copy u to the accelerations: in a plane they are the same numbers; see
    `kinematics_interface.window_accelerations`."""
    for d in range(_moving(model)):
        a[d] = u[d]


@part
def window_rates(model, x, y, a, u):
    """Copy accelerations to u: in a plane they are the same numbers; see `kinematics_interface.window_rates`."""
    for d in range(_moving(model)):
        u[d] = a[d]


@part
def window_size(model):
    """How many numbers a body has in `window_maps`: none in a plane."""
    return 0


@part
def window_maps(model, x, y, u, maps):
    """Do nothing: in a plane x, y, u are coordinates, velocities, accelerations; see
    `kinematics_interface.window_maps`."""


@part
def window_rates_with_maps(model, x, y, a, u, maps):
    """Copy accelerations to u, the same numbers; see `kinematics_interface.window_rates_with_maps`."""
    window_rates(model, x, y, a, u)


@part
def window_jvp(model, maps, dx, dy, dq, dv, da):
    """Copy changes of x and y to those of coordinates and velocities; see `kinematics_interface.window_jvp`."""
    for d in range(_moving(model)):
        dq[d] = dx[d]
        dv[d] = dy[d]
        da[d] = 0.0


@part
def window_vjp(model, maps, bar_q, bar_v, bar_a, bar_x, bar_y):
    """Copy cotangents of coordinates and velocities to those of x and y; see `kinematics_interface.window_vjp`."""
    for d in range(_moving(model)):
        bar_x[d] = bar_q[d]
        bar_y[d] = bar_v[d]


@part
def window_turn(model, maps, inverse, transposed, x):
    """Do nothing: in a plane x are the coordinates themselves; see `kinematics_interface.window_turn`."""


@part
def window_start_jvp(model, x, dq0, dq):
    """Add the change of a window's start to that of coordinates; see `kinematics_interface.window_start_jvp`."""
    for d in range(_moving(model)):
        dq[d] += dq0[d]


@part
def window_start_vjp(model, x, bar_q, bar_q0):
    """Add cotangents of coordinates to those of a window's start; see `kinematics_interface.window_start_vjp`."""
    for d in range(_moving(model)):
        bar_q0[d] += bar_q[d]


@part
def window_slopes(model, maps, coupled, by_x, by_y):
    """Do nothing: x, y are coordinates, velocities; see `kinematics_interface.window_slopes`."""
