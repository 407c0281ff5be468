"""A point of one body against a surface of another, in space.

As the first body sees it, in its axes, the point is at z = d + S c and moves at u = d' + w x S c. A surface gives the
height h(z), its slope n (|n| = 1), and by H = d2h/dz2 how n turns; room(z) is how far z is within the nearest end. With

    rise = n . u,   s = u - rise n,   f = N n - N e(|s|) s,   N = -k h - c rise            (`mechanics.contact`)

the force on the point is f, of which the freedoms feel B^T f, B = dz/dq. Its change is B^T df + d(B^T f)/dq at fixed f:

    dn = H dz,   d(rise) = n . du + u . dn,   ds = du - d(rise) n - rise dn
    df = dN n + N dn - dN e s - N (de s + e ds)
    dz = R_A^T (dx_B - dx_A) + z x dtheta_A + S (dtheta_B x c)
    du = (d' + omega_A x d) x dtheta_A + dz x omega_A + dphi x S (omega_B x c)

at given velocities, dphi as of `spatial_poses`.

A surface bends around a centre or an axis at the distance 1 / |curve|: H a = curve (a without its parts along n and
the axis). It is outside of a sphere or cylinder, or inside, where `side` is -1.
"""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.mechanics.contact import CLOSED, contact_force, drag_by_slide
from mdstopo.mechanics.kinematics.spatial_lines import add_column
from mdstopo.mechanics.kinematics.spatial_poses import (
    ATTITUDE,
    D_RATE,
    FREEDOMS,
    OMEGA_A,
    POSE,
    TURN_A,
    D,
    S,
    W,
    fill_attitude,
    fill_pose,
)
from mdstopo.mechanics.kinematics.vectors import (
    add,
    cross,
    dot,
    minus,
    norm,
    plus,
    put,
    times,
    turned,
    turned_back,
    unit,
    vector_at,
)

#: columns of `GeneralModel.contact` behind k, c, mu and slip (`mechanics.contact`), in the axes of the bodies: the
#: point; the shape; where it is (a point of a plane, centres, one end of an axis); the rectangle's two axes, and the
#: normal or the axis; the rectangle's half sides, or radius and length; the side
POINT, SHAPE, ORIGIN, FIRST_AXIS, SECOND_AXIS, NORMAL, SIZES, SIDE = 4, 7, 8, 11, 14, 17, 20, 22
WIDTH = 23
#: the shapes
PLANE, RECTANGLE, SPHERE, CYLINDER = range(4)
#: directions in which a contact pushes: along what it slides, across that, and normal to the surface
DIRECTIONS = 3
#: nearer than this (m) to a centre or an axis there is no normal; any will do
NO_DISTANCE = 1e-15

NOTHING = (0.0, 0.0, 0.0)


# Surfaces: each gives the height of a point z, the normal, how it bends (above), the room with its slope, and the end


@part
def on_plane(c, z):
    """A plane, which has no ends."""
    n = vector_at(c, NORMAL)
    return dot(n, minus(z, vector_at(c, ORIGIN))), n, 0.0, np.inf, NOTHING, 0


@part
def on_rectangle(c, z):
    """A rectangle, about its centre; ends are numbered along the first axis, against it, and so on."""
    n = vector_at(c, NORMAL)
    one = vector_at(c, FIRST_AXIS)
    two = vector_at(c, SECOND_AXIS)
    w = minus(z, vector_at(c, ORIGIN))
    x = dot(one, w)
    y = dot(two, w)
    first = c[SIZES] - abs(x)
    second = c[SIZES + 1] - abs(y)
    if first <= second:
        sign = -1.0 if x > 0.0 else 1.0
        return dot(n, w), n, 0.0, first, times(sign, one), 0 if x > 0.0 else 1
    sign = -1.0 if y > 0.0 else 1.0
    return dot(n, w), n, 0.0, second, times(sign, two), 2 if y > 0.0 else 3


@part
def around(c, w):
    """Height, normal and bend of what has the vector w from a centre or an axis, beyond the radius."""
    distance = norm(w)
    curve = c[SIDE] / max(distance, NO_DISTANCE)
    n = times(curve, w) if distance > NO_DISTANCE else times(c[SIDE], vector_at(c, FIRST_AXIS))
    return c[SIDE] * (distance - c[SIZES]), n, curve


@part
def on_sphere(c, z):
    """A sphere, which has no ends."""
    height, n, curve = around(c, minus(z, vector_at(c, ORIGIN)))
    return height, n, curve, np.inf, NOTHING, 0


@part
def on_cylinder(c, z):
    """A cylinder, between the ends of its axis."""
    axis = vector_at(c, NORMAL)
    w = minus(z, vector_at(c, ORIGIN))
    along = dot(axis, w)
    height, n, curve = around(c, minus(w, times(along, axis)))
    left = c[SIZES + 1] - along
    if along <= left:
        return height, n, curve, along, axis, 0
    return height, n, curve, left, times(-1.0, axis), 1


@part
def surface_at(c, z):
    """Height, normal, bend, room, its slope, and the end, of the shape that the contact c (WIDTH,) has."""
    shape = int(c[SHAPE])
    if shape == PLANE:
        return on_plane(c, z)
    if shape == RECTANGLE:
        return on_rectangle(c, z)
    if shape == SPHERE:
        return on_sphere(c, z)
    return on_cylinder(c, z)


@part
def bent(c, n, curve, a):
    """H a: the change of the normal n along a."""
    x = minus(a, times(dot(n, a), n))
    if int(c[SHAPE]) == CYLINDER:
        axis = vector_at(c, NORMAL)
        x = minus(x, times(dot(axis, a), axis))
    return times(curve, x)


# The point as the first body sees it


@part
def place_and_speed(c, r):
    """z and u of the contact c (WIDTH,) at the pose r (POSE,)."""
    arm = turned(r, S, vector_at(c, POINT))
    return plus(vector_at(r, D), arm), plus(vector_at(r, D_RATE), cross(vector_at(r, W), arm))


@kernel
def pose_of_contact(model, j, q, v, r):
    """r (POSE,): the relative pose of the pair of contact j at coordinates q (n_q,) and velocities v (n,)."""
    p = model.contact_pair[j]
    one = np.empty(ATTITUDE)
    two = np.empty(ATTITUDE)
    fill_attitude(model.home, model.pair[p, 0], q, one, 0)
    fill_attitude(model.home, model.pair[p, 1], q, two, 0)
    fill_pose(model, p, one, two, q, v, r)


@part
def point_row(c, r, z, e, row):
    """row (12,) = e B: how far z moves along e, in the axes of the first body, with the freedoms of both."""
    push = turned(r, TURN_A, e)
    put(row, 0, times(-1.0, push))
    put(row, 3, cross(e, z))
    put(row, 6, push)
    put(row, 9, cross(vector_at(c, POINT), turned_back(r, S, e)))


@part
def changes_of_point(c, r, z, spin, k):
    """dz, du at given velocities, dphi and dtheta_A, of freedom k of the pair.

    c (WIDTH,), r (POSE,), z: the contact, the pose, the point. spin: S omega_B.
    """
    e = unit(k % 3)
    omega = vector_at(r, OMEGA_A)
    speed = NOTHING
    turn = NOTHING
    dphi = NOTHING
    arm = turned(r, S, vector_at(c, POINT))
    if k < 3:
        dz = times(-1.0, turned_back(r, TURN_A, e))
    elif k < 6:
        turn = e
        dphi = times(-1.0, e)
        dz = cross(z, e)
        speed = cross(plus(vector_at(r, D_RATE), cross(omega, vector_at(r, D))), e)
    elif k < 9:
        dz = turned_back(r, TURN_A, e)
    else:
        dphi = turned(r, S, e)
        dz = cross(dphi, arm)
    du = plus(speed, plus(cross(dz, omega), cross(dphi, cross(spin, arm))))
    return dz, du, dphi, turn


@part
def contact_directions(model):
    """Two in the surface, and the normal."""
    return DIRECTIONS


@part
def contact_seen(model, j, r):
    """Height, rise, room and its rate, and the nearest end; see `kinematics_interface.contact_seen`."""
    c = model.contact[j]
    z, u = place_and_speed(c, r)
    height, n, _, room, inward, end = surface_at(c, z)
    return height, dot(n, u), room, dot(inward, u), end


@part
def contact_second_rise(model, j, r, acc):
    """n . z'' + u . H u, z'' = d'' + w' x a + w x (w x a); see `kinematics_interface.contact_second_rise`."""
    c = model.contact[j]
    z, u = place_and_speed(c, r)
    _, n, curve, _, _, _ = surface_at(c, z)
    arm = turned(r, S, vector_at(c, POINT))
    w = vector_at(r, W)
    push = plus(vector_at(acc, 0), plus(cross(vector_at(acc, 3), arm), cross(w, cross(w, arm))))
    return dot(n, push) + dot(u, bent(c, n, curve, u))


@part
def contact_distance(model, j, r):
    """The distance from the centre or the axis; see `kinematics_interface.contact_distance`."""
    c = model.contact[j]
    z, _ = place_and_speed(c, r)
    _, _, curve, _, _, _ = surface_at(c, z)
    return 1.0 / abs(curve) if curve != 0.0 else np.inf


@kernel
def contact_ends(model, j, q, v, rows, rate):
    """Height and room with their slopes; see `kinematics_interface.contact_ends`."""
    c = model.contact[j]
    r = np.empty(POSE)
    pose_of_contact(model, j, q, v, r)
    z, u = place_and_speed(c, r)
    height, n, curve, room, inward, _ = surface_at(c, z)
    point_row(c, r, z, inward, rows[0])
    point_row(c, r, z, n, rows[1])
    spin = plus(vector_at(r, W), vector_at(r, OMEGA_A))
    turning = bent(c, n, curve, u)
    for k in range(2 * FREEDOMS):
        dz, du, _, _ = changes_of_point(c, r, z, spin, k)
        rate[k] = dot(n, du) + dot(turning, dz)
    return height, room


@kernel
def contact_drag(model, j, q, v, rows):
    """Height, rise and slide with their rows; see `kinematics_interface.contact_drag`."""
    c = model.contact[j]
    r = np.empty(POSE)
    pose_of_contact(model, j, q, v, r)
    z, u = place_and_speed(c, r)
    height, n, _, _, _, _ = surface_at(c, z)
    rise = dot(n, u)
    sliding = minus(u, times(rise, n))
    slide = norm(sliding)
    if slide > 0.0:
        one = times(1.0 / slide, sliding)
    else:  # any direction in the surface
        e = unit(0 if abs(n[0]) < 0.7 else 1)
        one = minus(e, times(dot(n, e), n))
        one = times(1.0 / norm(one), one)
    point_row(c, r, z, one, rows[0])
    point_row(c, r, z, cross(n, one), rows[1])
    point_row(c, r, z, n, rows[2])
    return height, rise, sliding


@kernel
def add_contact(model, j, r, q, v, tangent, f, k, d):
    """The force of a closed contact; see `kinematics_interface.add_contact`."""
    c = model.contact[j]
    p = model.contact_pair[j]
    point = vector_at(c, POINT)
    z, u = place_and_speed(c, r)
    height, n, curve, _, _, _ = surface_at(c, z)
    rise = dot(n, u)
    s = minus(u, times(rise, n))
    normal, by_height, by_rise, _, _, _, _ = contact_force(c, height, rise, 0.0, CLOSED)
    grip, by_slide = drag_by_slide(c, norm(s))
    way = minus(n, times(grip, s))  # f by N
    push = times(normal, way)
    a = FREEDOMS * model.pair[p, 0]
    b = FREEDOMS * model.pair[p, 1]
    force = turned(r, TURN_A, push)
    add(f, a, times(-1.0, force))
    add(f, a + 3, cross(push, z))
    add(f, b, force)
    add(f, b + 3, cross(point, turned_back(r, S, push)))
    if not tangent:
        return
    spin = plus(vector_at(r, W), vector_at(r, OMEGA_A))
    for m in range(2 * FREEDOMS):
        dz, du, dphi, turn = changes_of_point(c, r, z, spin, m)
        for by_velocity in range(2):
            if by_velocity == 1:  # u = B v: at given places it changes with velocities as z does with places
                du = dz
                dz = NOTHING
                dphi = NOTHING
                turn = NOTHING
            dn = bent(c, n, curve, dz)
            change = dot(n, du) + dot(u, dn)
            ds = minus(du, plus(times(change, n), times(rise, dn)))
            more = by_height * dot(n, dz) + by_rise * change
            drag = plus(times(by_slide * dot(s, ds), s), times(grip, ds))
            df = plus(times(more, way), times(normal, minus(dn, drag)))
            force = turned(r, TURN_A, plus(df, cross(turn, push)))
            out = k if by_velocity == 0 else d
            add_column(out, 0, m, force)
            add_column(out, 3, m, times(-1.0, plus(cross(df, z), cross(push, dz))))
            add_column(out, 6, m, times(-1.0, force))
            moment = cross(point, turned_back(r, S, plus(df, cross(push, dphi))))
            add_column(out, 9, m, times(-1.0, moment))
