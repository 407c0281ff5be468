"""How thick each member is drawn: by its design value, or in a final design by its largest force or its law."""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from mdstopo.case.laws.law import with_role
from mdstopo.case.model import Case
from mdstopo.plots.member_forces import forces_of
from mdstopo.plots.same_members import family
from mdstopo.plots.scenery import Floats, sizes
from mdstopo.plots.source import Source
from mdstopo.plots.style import MOST_NAMED

#: share of members without any size of their own; of the largest, what is smaller is not drawn
PLAIN, FAINT = 0.5, 0.02
#: states of a stored motion, and members, up to which forces are computed
MANY_STATES, MANY_MEMBERS = 400, 20_000


@dataclass(frozen=True)
class Thickness:
    """How thick members are drawn. shares: of each group (M,), from 0 to 1, relative to the largest.

    quantity: what they show, empty where nothing. largest: how much a share of 1 is. value: of the quantity there, in a
    unit: alpha itself, where shares are of its range.
    """

    shares: tuple[Floats, ...]
    quantity: str
    largest: float = 0.0
    value: float = 0.0
    unit: str = ""

    @property
    def what(self) -> str:
        """What they show, in words; factors of laws have no number of one unit."""
        no_number = self.quantity in ("", "size")
        return self.quantity if no_number else f"{self.quantity}, up to {self.value:.3g}{self.unit}"


def alike(first: Source, second: Source) -> tuple[Thickness, Thickness]:
    """Of the members of two results, relative to the largest of both where they show the same."""
    one, other = thickness(first), thickness(second)
    if one.quantity != other.quantity:
        return one, other
    largest, value = max(one.largest, other.largest), max(one.value, other.value)
    one, other = thickness(first, largest=largest), thickness(second, largest=largest)
    return replace(one, value=value), replace(other, value=value)


def thickness(source: Source, alpha: Floats | None = None, largest: float = 0.0) -> Thickness:
    """Of every group of the case. alpha: another design than the one of the file; largest: what shares are relative to,
    0 for the largest there is.

    Where a group has a range, members are as thick as their share of it, relative to the thickest; those that are not
    varied have half of that. Where nothing is varied, their largest forces in the motions that the file has; without
    these, the factor of their laws where these are of one kind.
    """
    case = source.case
    design = source.alpha if alpha is None else alpha
    slices = case.group_slices
    varied = [group.design and group.upper > group.lower for group in case.members]
    if not any(varied):
        return _of_final(source, design, largest)
    shares = [sizes(group, design[slices[group.name]]) if group.design else None for group in case.members]
    ranged = [share for share, varies in zip(shares, varied, strict=True) if varies and share is not None]
    top = max((float(share.max(initial=0.0)) for share in ranged), default=0.0)
    most = largest or top or 1.0
    value = max(
        float(design[slices[group.name]][share >= top].max(initial=0.0))
        for group, share, varies in zip(case.members, shares, varied, strict=True)
        if varies and share is not None
    )
    found = []
    for group, share, varies in zip(case.members, shares, varied, strict=True):
        if varies and share is not None:
            found.append(share / most)
        else:
            found.append(np.full(len(group), PLAIN) if share is None else share)
    return Thickness(tuple(found), "alpha", most, value)


def _of_final(source: Source, design: Floats, largest: float) -> Thickness:
    case = source.case
    peaks = stored_peaks(source, design) if case.n_members <= MANY_MEMBERS else None
    shown, unit = "largest force", " N"
    if peaks is None or not any(np.any(each) for each in peaks):
        peaks, shown, unit = _factors(case, design), "size", ""
    if peaks is None:
        return Thickness(tuple(np.full(len(group), PLAIN) for group in case.members), "")
    most = largest or max((float(each.max(initial=0.0)) for each in peaks), default=0.0) or 1.0
    # a member that never pulls is there all the same
    shares = tuple(np.maximum(each / most, 2.0 * FAINT) for each in peaks)
    return Thickness(shares, shown, most, most, unit)


def stored_peaks(source: Source, design: Floats) -> list[Floats] | None:
    """(M,) of each group: the largest |f*| of all load cases in the motions of the file; None where it cannot be told.

    At the steps that the file has, in the plane also between them, by the cubic polynomials of states and rates.
    """
    case = source.case
    every = [(group, np.arange(len(group))) for group in case.members]
    found = np.zeros(case.n_members)
    for name in source.load_cases:
        stored = source.view.under(f"trajectories/{name}")
        if "q" not in stored or "v" not in stored or not len(stored["q"]):
            return None
        chosen = np.unique(np.linspace(0, len(stored["q"]) - 1, MANY_STATES).astype(int))
        q, v = stored["q"][chosen], stored["v"][chosen]
        if case.dimension == 2 and len(stored["t"]) > 1:
            between = CubicHermiteSpline(stored["t"], stored["q"], stored["v"])
            times = np.linspace(stored["t"][0], stored["t"][-1], MANY_STATES)
            q, v = np.concatenate([q, between(times)]), np.concatenate([v, between(times, 1)])
        forces = forces_of(case, design, every, q, v)
        if forces is None:
            return None
        found = np.maximum(found, np.abs(forces).max(axis=0, initial=0.0))
    return [found[part] for part in _parts(case)]


def _parts(case: Case) -> list[slice]:
    ends = np.cumsum([0, *(len(group) for group in case.members)]).tolist()
    return [slice(a, b) for a, b in itertools.pairwise(ends)]


def _factors(case: Case, design: Floats) -> list[Floats] | None:
    """(M,) of each group: alpha^mu times what scales its laws, where the laws of all are of one kind; else None."""
    kinds = {tuple(law.type for law in group.laws) for group in case.members}
    names = {tuple(with_role(type(law), "scales")) for group in case.members for law in group.laws}
    if len(kinds) != 1 or not all(len(each) for each in names):
        return None
    slices = case.group_slices
    found = []
    for group in case.members:
        numbers = [getattr(law, name) for law in group.laws for name in with_role(type(law), "scales")]
        plain = [abs(float(number)) for number in numbers if isinstance(number, int | float)]
        if not plain:
            return None
        scale = design[slices[group.name]] ** group.power if group.design else np.ones(len(group))
        found.append(scale * max(plain))
    return found


def families(case: Case) -> list[str]:
    """What each group is called in a legend, and coloured by: in a final design, where each member is a group, its name
    without the number."""
    names = [group.name for group in case.members]
    if len(names) <= MOST_NAMED:
        return names
    return [family(name) for name in names]


def strongest(shares: tuple[Floats, ...], most: int) -> list[NDArray[np.int64]]:
    """Of each group the members that are thick enough to be seen, in order; of many the thickest."""
    every = np.concatenate(shares) if shares else np.zeros(0)
    least = float(np.partition(every, -most)[-most]) if len(every) > most else 0.0
    found, room = [], most
    for share in shares:
        chosen = np.flatnonzero((share > FAINT) & (share >= least))[:room]
        room -= len(chosen)
        found.append(chosen)
    return found
