"""The fixed joint: two points coincide, as in the revolute one, and the angle psi_B - psi_A stays theta_0.

Parameters: those of the revolute joint. theta_0 is the angle at home.
"""

from mdstopo.compiler.jit import kernel
from mdstopo.mechanics.joints.joint_kernels import JointKernels
from mdstopo.mechanics.joints.revolute import (
    point_at_home,
    revolute_acceleration_slopes,
    revolute_gamma,
    revolute_rows,
    revolute_stiffness,
    revolute_velocity_slope,
)


@kernel
def fixed_rows(par, w, phi, jac):
    """The three Phi of a fixed joint and their slopes Phi_q; those of the angle are constant, the others the revolute
    joint's."""
    revolute_rows(par, w, phi, jac)
    phi[2] = w[5] - w[2]
    for i in range(6):
        jac[2, i] = 0.0
    jac[2, 2] = -1.0
    jac[2, 5] = 1.0


@kernel
def fixed_gamma(par, w, wd, gamma):
    """gamma of Phi_q a + gamma = 0: the centripetal accelerations of the points; the angle has none."""
    revolute_gamma(par, w, wd, gamma)
    gamma[2] = 0.0


@kernel
def fixed_velocity_slope(par, w, wd, out):
    """Slopes of the rate of Phi by coordinates, d(Phi_q v)/dq; those of the angle's row are zero."""
    revolute_velocity_slope(par, w, wd, out)
    for i in range(6):
        out[2, i] = 0.0


@kernel
def fixed_acceleration_slopes(par, w, wd, wdd, by_q, by_v):
    """Slopes of Phi_q a + gamma at fixed a; the angle's rows are zero.

    In:
      par (WIDTH,): parameters of the joint.
      w (PLACES,): where both bodies are (`revolute.place_joint`).
      wd, wdd (6,): their velocities and accelerations (m/s, rad/s; m/s^2, rad/s^2).
    Out:
      by_q (3, 6): d(Phi_q a + gamma)/dq.
      by_v (3, 6): d(gamma)/dv.
    """
    revolute_acceleration_slopes(par, w, wd, wdd, by_q, by_v)
    for i in range(6):
        by_q[2, i] = 0.0
        by_v[2, i] = 0.0


@kernel
def fixed_moment(lam, by_lam):
    """The moment of the joint: the multiplier of the angle's row."""
    by_lam[2] = 1.0
    return lam[2]


KERNELS = JointKernels(
    at_home=point_at_home,
    steady=((0, 1), (0, 1), (0, 1, 2)),
    phi=fixed_rows,
    gamma=fixed_gamma,
    velocity_slope=fixed_velocity_slope,
    acceleration_slopes=fixed_acceleration_slopes,
    stiffness=revolute_stiffness,
    force_rows=2,
    moment=fixed_moment,
    is_point=True,
)
