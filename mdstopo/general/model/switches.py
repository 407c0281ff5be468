"""What is known of a scene before it moves, and spares work at every balance."""

import numpy as np

from mdstopo.compiler.jit import kernel, part
from mdstopo.general.model.general_model import CODE, ENERGY, INERTER, KIND, PAIR
from mdstopo.mechanics.kinematics.kinematics_interface import freedoms, load_slopes, rotations
from mdstopo.mechanics.laws.law_table import SPRING

#: how many switches a workspace has
SWITCHES = 8
#: places of a workspace's `switches`: whether the mass is diagonal; whether the factors in the workspace are those of
#: the joints' matrix; whether forces may depend on rates (else `c` stays zero); whether joints are searched for a small
#: eigenvalue; whether tangents leave out the joints' part; whether loads may depend on how bodies turn (else `turn`
#: stays zero); whether tangents are left as what they follow from: poses and sums over members of pairs, and the state;
#: whether a response is the stored energy, which is then kept at stages where steps begin or end
DIAGONAL, OF_JOINTS, DAMPED, THOROUGH, APART, TURNING, UNFORMED, STORED = range(SWITCHES)
#: which bodies of a pair move (`movers_of`)
BOTH, SECOND, FIRST = 1, 2, 3


@kernel
def set_switches(model, switches):
    """Set the switches (SWITCHES,) of a new workspace, zeros before: what the scene decides once."""
    switches[DIAGONAL] = 1 if is_diagonal(model) else 0
    switches[DAMPED] = 1 if is_damped(model) else 0
    switches[THOROUGH] = 1
    switches[TURNING] = 1 if loads_turn(model) else 0
    for j in range(model.response.shape[0]):
        if model.response[j, KIND] == ENERGY:
            switches[STORED] = 1


@kernel
def loads_turn(model):
    """Whether loads may depend on how bodies turn: those at points do, and gyroscopic moments."""
    gyroscopic = load_slopes(model) > rotations(model)
    return gyroscopic or model.load_body.shape[0] + model.timed_load.shape[0] > 0


@kernel
def is_diagonal(model):
    """Whether the mass matrix is diagonal: only inerters couple accelerations."""
    inertial = 0
    for k in range(model.block.shape[0]):
        inertial += model.block[k, CODE] == INERTER
    return inertial == 0


@kernel
def is_damped(model):
    """Whether forces may depend on rates: all but springs and bushings without damping are taken to do so."""
    damped = model.contact_pair.shape[0]
    for k in range(model.block.shape[0]):
        damped += model.block[k, CODE] != SPRING or model.law[k, 1] != 0.0
    for j in range(model.bushing.shape[0]):
        last = model.bushing.shape[1]
        for i in range(last - freedoms(model), last):
            damped += model.bushing[j, i] != 0.0
    return damped != 0


@kernel
def carriers(model):
    """(n_pair,) which bodies move, as of `movers_of`, where members, bushings or contacts act between them; 0 where
    only joints do."""
    found = np.zeros(model.pair.shape[0], np.int64)
    set_carriers(model, found)
    return found


@kernel
def set_carriers(model, found):
    """Set found (n_pair,), zeros before, to what `carriers` returns."""
    for k in range(model.block.shape[0]):
        found[model.block[k, PAIR]] = 1
    for j in range(model.bushing_pair.shape[0]):
        found[model.bushing_pair[j]] = 1
    for j in range(model.contact_pair.shape[0]):
        found[model.contact_pair[j]] = 1
    for p in range(found.shape[0]):
        found[p] *= movers_of(model, p)


@part
def movers_of(model, p):
    """Which bodies of pair p move: BOTH, or FIRST or SECOND alone."""
    each = freedoms(model)
    first = 0
    second = 0
    for i in range(each):
        first += model.free[each * model.pair[p, 0] + i] != 0
        second += model.free[each * model.pair[p, 1] + i] != 0
    return FIRST if second == 0 else (SECOND if first == 0 else BOTH)
