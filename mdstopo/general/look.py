"""What Python calls for integrals over time and their gradients, by the adjoint sweep; rows: `row_sweep`."""

from mdstopo.compiler.jit import entry
from mdstopo.general.adjoint import integral_gradient
from mdstopo.general.balance import make_desk
from mdstopo.general.members import unscale_general
from mdstopo.general.model import unpack_general
from mdstopo.general.track import carve_track


@entry
def pull(
    tag,
    ints,
    floats,
    tables,
    alpha,
    limits,
    count,
    j,
    integral,
    gradient,
    room,
    room_ints,
    strength,
    padded,
    out,
    start,
    work,
):
    """The integral over time of response j, or where integral is 2 of its square; on demand its derivative by alpha.

    out (N + P,); padded (M_padded + P,): room. start: as of `adjoint.integral_gradient`.
    """
    model = unpack_general(ints, floats)
    track = carve_track(model, limits, room, room_ints)
    desk = make_desk(model)
    total = integral_gradient(
        tag, model, tables, strength, track, count, j, integral == 2, gradient, desk, start, padded, work
    )
    if gradient:
        unscale_general(model.block, model.power, alpha, padded, out)
    return total
