"""Laws by formula that are linear springs become springs, which have vectors over many members; formulas have none."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from mdstopo.case.laws.expression import OfFormulas, names_of
from mdstopo.case.laws.spring import SpringLaw
from mdstopo.case.model import Case, Law, MemberGroup
from mdstopo.formula.law_formulas import FORCE
from mdstopo.formula.tree import NAME, NUMBER, Expression, parts
from mdstopo.mechanics.laws.table import COMMON

#: products of names, each with its factor
Polynomial = dict[tuple[str, ...], Fraction]
#: terms that a factor has at most
MOST_TERMS = 12
#: a law of a group: the group's name, and the place of the law
Place = tuple[str, int]


def spring_of(law: Law) -> tuple[SpringLaw, dict[str, str]] | None:
    """The spring that a law by formula is, and what each parameter of the formula is there; None of other laws.

    Force and energy have to be k x + c xd + p and k x^2 / 2, where each of k, c and p is a number or another parameter.
    """
    if not isinstance(law, OfFormulas) or law.program.switches:
        return None
    f, _, _, v, _ = law.program.groups[FORCE].values
    force, energy = polynomial(f), polynomial(v)
    if force is None or energy is None:
        return None
    shares = [_share(force, word) for word in ("x", "xd", "")]
    squared = {tuple(sorted((*monomial, "x", "x"))): factor / 2 for monomial, factor in shares[0].items()}
    if sum(map(len, shares)) != len(force) or energy != squared:
        return None
    words = names_of(type(law))
    numbers: dict[str, float] = {}
    taken: dict[str, str] = {}
    for parameter, share in zip(("stiffness", "damping", "preload"), shares, strict=True):
        if not share.keys() - {()}:
            numbers[parameter] = float(share.get((), 0))
            continue
        ((monomial, factor), *others) = share.items()
        word = words[int(monomial[0].split()[1])]
        if others or len(monomial) > 1 or factor != 1 or word in taken:
            return None
        numbers[parameter], taken[word] = law.values[word], parameter
    common: dict[str, Any] = {key: getattr(law, key) for key in COMMON}
    return SpringLaw(**numbers, **common), taken


def _share(form: Polynomial, word: str) -> Polynomial:
    """What a name of the motion alone is multiplied with, in parameters; without a word: what stands for itself."""
    found = {}
    for monomial, factor in form.items():
        moved = [each for each in monomial if not each.startswith("p ")]
        if moved == ([word] if word else []):
            found[tuple(each for each in monomial if each.startswith("p "))] = factor
    return found


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
    if part.operator == "^" and factor in (1, 2):
        return first if factor == 1 else _product(first, first)
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
    """The case in which laws by formula that are springs are springs, and their variables are those of springs."""
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


def _renamed(case: Case, found: dict[Place, tuple[SpringLaw, dict[str, str]]]) -> Mapping[str, str]:
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


def _changed(group: MemberGroup, found: Mapping[Place, tuple[SpringLaw, Any]]) -> MemberGroup:
    laws = tuple(
        found[group.name, place][0] if (group.name, place) in found else law for place, law in enumerate(group.laws)
    )
    return group if laws == group.laws else replace(group, laws=laws)
