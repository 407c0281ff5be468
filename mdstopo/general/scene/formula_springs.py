"""Laws by formula that are springs, linear or cubic, become the built-in ones, which are computed faster."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from mdstopo.case.laws.cubic_law import CubicLaw
from mdstopo.case.laws.expression_law import OfFormulas, names_of
from mdstopo.case.laws.spring_law import SpringLaw
from mdstopo.case.model import Case, Law, MemberGroup
from mdstopo.formula.law_formulas import FORCE
from mdstopo.formula.tree import NAME, NUMBER, Expression, parts
from mdstopo.mechanics.laws.law_table import COMMON

#: products of names, each with its factor
Polynomial = dict[tuple[str, ...], Fraction]
#: terms that a factor has at most
MOST_TERMS = 12
#: a law of a group: the group's name, and the place of the law
Place = tuple[str, int]


def spring_of(law: Law) -> tuple[SpringLaw | CubicLaw, dict[str, str]] | None:
    """The built-in spring that a law by formula equals, and what each parameter of the formula is of it; None where
    it equals none.

    Force and energy have to be k x + c xd + p and k x^2 / 2, or k x + b x^3 and k x^2 / 2 + b x^4 / 4, where each of k,
    c, p and b is a number or another parameter.
    """
    if not isinstance(law, OfFormulas) or law.program.switches:
        return None
    f, _, _, v, _ = law.program.groups[FORCE].values
    force, energy = polynomial(f), polynomial(v)
    if force is None or energy is None:
        return None
    linear = {"stiffness": _share(force, "x"), "damping": _share(force, "xd"), "preload": _share(force)}
    if sum(map(len, linear.values())) == len(force) and energy == _stored({2: linear["stiffness"]}):
        return _made(law, SpringLaw, linear)
    cubic = {"stiffness": _share(force, "x"), "cubic": _share(force, "x", "x", "x")}
    stored = _stored({2: cubic["stiffness"], 4: cubic["cubic"]})
    if sum(map(len, cubic.values())) == len(force) and energy == stored:
        return _made(law, CubicLaw, cubic)
    return None


def _made(
    law: OfFormulas, kind: type[SpringLaw] | type[CubicLaw], shares: Mapping[str, Polynomial]
) -> tuple[SpringLaw | CubicLaw, dict[str, str]] | None:
    """The law of a kind with these shares of the force as its parameters; None where one is no number and no name."""
    words = names_of(type(law))
    numbers: dict[str, float] = {}
    taken: dict[str, str] = {}
    for parameter, share in shares.items():
        if not share.keys() - {()}:
            numbers[parameter] = float(share.get((), 0))
            continue
        ((monomial, factor), *others) = share.items()
        word = words[int(monomial[0].split()[1])]
        if others or len(monomial) > 1 or factor != 1 or word in taken:
            return None
        numbers[parameter], taken[word] = law.values[word], parameter
    common: dict[str, Any] = {key: getattr(law, key) for key in COMMON}
    return kind(**numbers, **common), taken


def _share(form: Polynomial, *words: str) -> Polynomial:
    """What a product of names of the motion is multiplied with, in parameters; without a name: what stands alone."""
    found = {}
    for monomial, factor in form.items():
        moved = [each for each in monomial if not each.startswith("p ")]
        if moved == list(words):
            found[tuple(each for each in monomial if each.startswith("p "))] = factor
    return found


def _stored(shares: Mapping[int, Polynomial]) -> Polynomial:
    """The sum of shares times x to their power, each by that power."""
    return {
        tuple(sorted((*monomial, *["x"] * power))): factor / power
        for power, share in shares.items()
        for monomial, factor in share.items()
    }


def polynomial(root: Expression) -> Polynomial | None:
    """A formula as a sum of products of names, with exact factors; None where it is none, or a long one."""
    known: dict[Expression, Polynomial | None] = {}
    for part in parts(root):
        known[part] = _polynomial(part, [known[each] for each in part.operands])
    return known[root]


def _polynomial(part: Expression, operands: Sequence[Polynomial | None]) -> Polynomial | None:
    """That of an operation of polynomials."""
    if part.operator == NUMBER:
        return {(): Fraction(part.value)} if part.value else {}
    if part.operator == NAME:
        return {(part.word,): Fraction(1)}
    if any(each is None or len(each) > MOST_TERMS for each in operands):
        return None
    first, *others = (each for each in operands if each is not None)
    second = others[0] if others else {}
    if part.operator in ("+", "-"):
        return _sum(first, second, 1 if part.operator == "+" else -1)
    if part.operator == "neg":
        return _sum({}, first, -1)
    if part.operator == "*":
        return _product(first, second)
    factor = second.get((), Fraction(0))
    if second.keys() - {()} or not factor:
        return None
    if part.operator == "/":
        return _product(first, {(): 1 / factor})
    if part.operator == "^" and factor in (1, 2, 3, 4):
        power = first
        for _ in range(int(factor) - 1):
            power = _product(power, first)
        return power
    return None


def _sum(one: Polynomial, other: Polynomial, sign: int) -> Polynomial:
    found = {each: one.get(each, Fraction(0)) + sign * other.get(each, Fraction(0)) for each in {**one, **other}}
    return {monomial: factor for monomial, factor in found.items() if factor}


def _product(one: Polynomial, other: Polynomial) -> Polynomial:
    found: Polynomial = {}
    for first, factor in one.items():
        for second, times in other.items():
            found = _sum(found, {tuple(sorted((*first, *second))): factor * times}, 1)
    return found


def with_springs(case: Case) -> Case:
    """The case with built-in springs in the place of laws by formula that equal them, and their variables changed
    accordingly."""
    found = {
        (group.name, place): made
        for group in case.members
        for place, law in enumerate(group.laws)
        if (made := spring_of(law)) is not None
    }
    if not found:
        return case
    renamed = _renamed(case, found)
    variables = tuple(replace(each, parameter=renamed.get(each.name, each.parameter)) for each in case.variables)
    return replace(case, members=tuple(_changed(group, found) for group in case.members), variables=variables)


def _renamed(case: Case, found: dict[Place, tuple[SpringLaw | CubicLaw, dict[str, str]]]) -> Mapping[str, str]:
    """What each variable of springs is called there; springs with a variable that cannot be renamed are taken out."""
    renamed: dict[str, str] = {}
    pending = True
    while pending:
        pending = False
        for each in case.variables:
            places = list(zip(each.groups, each.laws, strict=True))
            own = {place: found[place][1].get(each.parameter) for place in places if place in found}
            if not own or each.parameter in COMMON:
                continue
            words = set(own.values())
            if len(own) == len(places) and len(words) == 1 and None not in words:
                renamed[each.name] = str(words.pop())
                continue
            renamed.pop(each.name, None)
            for place in own:
                del found[place]
            pending = True
    return {key: word for key, word in renamed.items() if _is_of(case, key, found)}


def _is_of(case: Case, variable: str, found: Mapping[Place, Any]) -> bool:
    """Whether the laws of a variable are all springs now."""
    each = next(each for each in case.variables if each.name == variable)
    return all(place in found for place in zip(each.groups, each.laws, strict=True))


def _changed(group: MemberGroup, found: Mapping[Place, tuple[SpringLaw | CubicLaw, Any]]) -> MemberGroup:
    laws = tuple(
        found[group.name, place][0] if (group.name, place) in found else law for place, law in enumerate(group.laws)
    )
    return group if laws == group.laws else replace(group, laws=laws)
