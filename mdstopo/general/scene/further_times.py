"""Further times at which steps of a compiled scene end."""

from collections.abc import Sequence

import numpy as np

from mdstopo.general.model.general_model import GeneralModel
from mdstopo.general.scene.driven_integrals import integrated_ends
from mdstopo.mechanics.kinematics.timed import COORDINATE, DERIVED
from mdstopo.scene.signal_segments import cut_linear, cut_segments, parents_of


def landed(model: GeneralModel, times: Sequence[float]) -> GeneralModel:
    """The model with further times at which segments end; loads and laws are the same functions of time as before."""
    further = cut_segments(model, times)
    whole = further.times
    parent, tau = parents_of(model.times, whole)
    d = model.drive[parent]
    x = tau[:, None]
    drive = np.stack(
        [
            d[..., 0] + x * (d[..., 1] + x * (d[..., 2] + x * d[..., 3])),
            d[..., 1] + x * (2.0 * d[..., 2] + 3.0 * x * d[..., 3]),
            d[..., 2] + 3.0 * x * d[..., 3],
            d[..., 3],
        ],
        axis=-1,
    )
    for i in np.flatnonzero(model.driven_par[:, DERIVED] != COORDINATE).tolist():
        row, sides = model.driven_par[i], model.driven_mode[parent, i]
        start = drive[0, i, 0], drive[0, i, 1]
        drive[:, i, :2] = integrated_ends(row, sides, whole, *start)[:, 0]
    return further._replace(
        active=model.active[parent],
        timed_mode=model.timed_mode[parent],
        driven_mode=model.driven_mode[parent],
        level=cut_linear(model.level, parent, tau),
        drive=drive.reshape(len(parent), *model.drive.shape[1:]),
    )
