"""What Python calls for the gradients of a general scene's objectives, by the adjoint sweep."""

from mdstopo.general.adjoint import integral_gradient, row_gradient
from mdstopo.general.balance import make_desk
from mdstopo.general.members import unscale_general
from mdstopo.general.model import unpack_general
from mdstopo.general.track import carve_track
from mdstopo.jit import entry


@entry
def pull(  # type: ignore[no-untyped-def]
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
    row,
    across,
    room,
    room_ints,
    strength,
    padded,
    out,
    start,
    work,
):
    """out (N,) = the derivative of one row of `extremes` by alpha (N,).

    integral 1 (2): of the integral over time of response j (of its square), which is returned. Room: padded
    (M_padded,). across: as of `adjoint.row_cotangents`. start: as of `adjoint.row_gradient`.
    """
    model = unpack_general(ints, floats)
    track = carve_track(model, limits, room, room_ints)
    desk = make_desk(model)
    total = 0.0
    if integral > 0:
        total = integral_gradient(
            tag, model, tables, strength, track, count, j, integral == 2, gradient, desk, start, padded, work
        )
    elif gradient:
        row_gradient(tag, model, tables, strength, track, count, j, row, across, desk, start, padded, work)
    if gradient:
        unscale_general(model.block, model.power, alpha, padded, out)
    return total
