"""What kernels ask of a law's formulas: values and derivatives, in groups."""

from __future__ import annotations

import functools
from typing import NamedTuple

from mdstopo.formula.calculus import ZERO, add, derivative, is_number, simplified, substituted
from mdstopo.formula.modes import smooth
from mdstopo.formula.parser import parse
from mdstopo.formula.tree import Expression, name

Group = tuple[Expression, ...]


class Program(NamedTuple):
    """Groups of formulas, and how many parameters and switches they have."""

    groups: tuple[Group, ...]
    parameters: int
    switches: int

    @property
    def has_timed_switches(self) -> bool:
        """Whether the margin of a switch depends on time."""
        first = 2 + self.parameters
        return any(not is_number(group[3], 0.0) for group in self.groups[first : first + self.switches])


@functools.lru_cache(maxsize=256)
def program(force: str | None, energy: str | None, damping: str | None, names: tuple[str, ...]) -> Program:
    """What kernels ask of a law's formulas.

    Names in them are x, xd, t, l0, "p 0" and so on for parameters, "bit 0" and so on for switches. Groups are: f, f_x,
    f_xd, V, V_x; then for each parameter, and for the free length, f_p, V_p; then for each switch its margin g, g_x,
    g_xd, g_t, and whether it is looked at; then g_p, by switches, for each parameter and the free length.
    """
    places = {name(word): name(f"p {place}") for place, word in enumerate(names)}
    known = {**places, name("l"): add(name("x"), name("l0"))}

    def read(text: str | None) -> Expression:
        return ZERO if text is None else substituted(parse(text).root, known)

    moving = ("x", "xd", "t")
    if force is None:
        found = smooth((read(energy), read(damping)), moving)
        v, damped = found.formulas
        f = add(derivative(v, "x"), damped)
    else:
        found = smooth((read(force), read(energy)), moving)
        f, v = found.formulas
    words = [*(f"p {place}" for place in range(len(names))), "l0"]
    groups: list[Group] = [(f, derivative(f, "x"), derivative(f, "xd"), v, derivative(v, "x"))]
    groups += [(derivative(f, word), derivative(v, word)) for word in words]
    for margin, relevant in found.switches:
        groups.append((margin, *(derivative(margin, word) for word in ("x", "xd", "t")), relevant))
    groups += [(derivative(margin, word),) for margin, _ in found.switches for word in words]
    cleaned = tuple(tuple(simplified(each) for each in group) for group in groups)
    return Program(cleaned, len(names), len(found.switches))
