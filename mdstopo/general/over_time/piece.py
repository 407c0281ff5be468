"""A piece of a step of a finished motion, on which a response is smooth."""

from typing import NamedTuple

#: the smallest share of a step that a piece is
EDGE = 1e-9


class Piece(NamedTuple):
    """The part of a step from fraction `low` to `high`.

    who: the member that carries the largest force in it, within its group; of an expression the sides of its switches
    (`general/model/expressions.py`); -1 where nothing changes between pieces.
    """

    step: int
    low: float
    high: float
    who: int


def distinct_cuts(cuts: list[float]) -> list[float]:
    """Cuts, rising from 0, without those next to each other or to the end of the step."""
    kept = cuts[:1]
    for cut in cuts[1:]:
        if cut - kept[-1] > EDGE and cut < 1.0 - EDGE:
            kept.append(cut)
    return kept


def add_piece(pieces: list[Piece], piece: Piece) -> None:
    """Put a piece behind others, or let the last one go on where it is of the same step and the same who."""
    if pieces and pieces[-1].step == piece.step and pieces[-1].who == piece.who:
        pieces[-1] = pieces[-1]._replace(high=piece.high)
    else:
        pieces.append(piece)
