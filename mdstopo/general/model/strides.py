"""Where the entries of a body, a pair or a joint stand among those of all bodies, and those of sums over members.

A pair has 2 D entries: the freedoms of its first body, then of its second (`kinematics_interface`); so has a joint. All
of these are constants, or a product with one, where a kernel is compiled.
"""

from mdstopo.compiler.jit import part
from mdstopo.general.model.general_model import JOINT_FIRST
from mdstopo.mechanics.kinematics.kinematics_interface import coordinates, freedoms, rotations

#: where the force begins in sums over the members of a pair (`sums_size`)
FORCE = 0


@part
def pair_freedoms(model):
    """2 D: freedoms of the two bodies of a pair or a joint."""
    return 2 * freedoms(model)


@part
def dimensions(model):
    """How many coordinates a point has, and components a displacement: D - T."""
    return freedoms(model) - rotations(model)


@part
def is_spatial(model):
    """Whether bodies move in space: only there they have more coordinates than freedoms."""
    return coordinates(model) != freedoms(model)


@part
def first_freedom(model, body):
    """The place of a body's first freedom among those of all bodies."""
    return freedoms(model) * body


@part
def place_in_pair(model, p, r):
    """The place of entry r (0 to 2 D - 1) of pair p among the freedoms of all bodies."""
    each = freedoms(model)
    return each * model.pair[p, r // each] + r % each


@part
def place_in_joint(model, j, r):
    """The place of entry r (0 to 2 D - 1) of joint j among the freedoms of all bodies."""
    each = freedoms(model)
    return each * model.joint[j, JOINT_FIRST + r // each] + r % each


@part
def place_of_turn(model, d, r):
    """The place of component r (0 to T - 1) of the rotation of the body to which freedom d belongs."""
    each = freedoms(model)
    return d - d % each + (each - rotations(model)) + r


@part
def is_turning(model, r):
    """Whether entry r of a pair's freedoms is a rotation, not a displacement."""
    each = freedoms(model)
    return r % each >= each - rotations(model)


@part
def energy_column(model):
    """Where the energy stands in sums over the members of a pair."""
    return freedoms(model)


@part
def pull_column(model):
    """Where the slope of the energy by the relative pose begins in sums over the members of a pair."""
    return freedoms(model) + 1


@part
def tangent_column(model):
    """Where K begins in sums over the members of a pair; sums without tangents end there."""
    return 2 * freedoms(model) + 1


@part
def sums_size(model):
    """SUMS: Q (D), E, E_xi (D), K (D, D), and the upper triangle of C."""
    each = freedoms(model)
    return 2 * each + 1 + each * each + each * (each + 1) // 2
