"""When the switches of an expression change their sides: the times at which their margins vanish."""

import numpy as np

from mdstopo.case.responses.expression_response import program_of
from mdstopo.general.driver_interface import DriverWithRun
from mdstopo.general.over_time.piece import Piece, add_piece, distinct_cuts
from mdstopo.general.responses.extremes import FRACTIONS
from mdstopo.general.responses.sampled_roots import may_vanish, roots_between
from mdstopo.scene.springs_model import FloatArray


def pieces_by_sides(driver: DriverWithRun, j: int, t: FloatArray) -> list[Piece]:
    """The pieces in which the switches of expression j keep their sides, in order of time; t (m + 1,): the steps'
    times."""
    count = len(t) - 1
    fractions = np.array(FRACTIONS)
    places = np.column_stack([np.repeat(np.arange(count), len(fractions)), np.tile(fractions, count)]).astype(float)
    cuts = _cuts(driver, j, t, places)
    middle = np.column_stack([np.arange(count), np.full(count, 0.5)])
    middle_sides = driver.sample_response(j, middle, False, count, rates=False)[2][:, 2]
    pieces: list[Piece] = []
    for w in range(count):
        ends = [*distinct_cuts([0.0, *sorted(cuts.get(w, []))]), 1.0]
        sides = [int(middle_sides[w])]
        if len(ends) > 2:
            middles = 0.5 * (np.array(ends[:-1]) + np.array(ends[1:]))
            inside = np.column_stack([np.full(len(middles), float(w)), middles])
            seen = driver.sample_response(j, inside, True, count, rates=False)[2][:, 2]
            sides = [int(each) for each in seen]
        for low, high, side in zip(ends[:-1], ends[1:], sides, strict=True):
            add_piece(pieces, Piece(w, low, high, side))
    return pieces


def moving_switches(driver: DriverWithRun, j: int) -> list[int]:
    """The switches of response j that change by the motion; those that change by time alone do so where segments
    end."""
    response = driver.scene.responses[j]
    return np.flatnonzero(~np.array(program_of(response).by_time_alone, dtype=bool)).tolist() if response.of else []


def _cuts(driver: DriverWithRun, j: int, t: FloatArray, places: FloatArray) -> dict[int, list[float]]:
    """By step, the fractions at which a margin vanishes in it. places (m K, 2): the FRACTIONS of all steps."""
    count, samples = len(t) - 1, len(FRACTIONS)
    cuts: dict[int, list[float]] = {}
    for switch in moving_switches(driver, j):
        seen = driver.sample_response(j, places, False, count, who=-2 - switch)[2].reshape(count, samples, -1)
        margin, rate = seen[:, :, 0], seen[:, :, 1] * (np.diff(t) / (samples - 1))[:, None]
        for w, k in np.argwhere(may_vanish(margin, rate)).tolist():

            def exact(c: FloatArray, w: int = w, who: int = -2 - switch) -> FloatArray:
                at = np.column_stack([np.full(len(c), float(w)), c])
                value: FloatArray = driver.sample_response(j, at, True, count, who=who, rates=False)[2][:, 0]
                return value

            span = FRACTIONS[k], FRACTIONS[k + 1]
            values = float(margin[w, k]), float(margin[w, k + 1])
            rates = float(rate[w, k]), float(rate[w, k + 1])
            cuts.setdefault(w, []).extend(roots_between(span, values, rates, exact))
    return cuts
