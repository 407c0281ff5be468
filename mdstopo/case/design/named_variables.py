"""Design variables of defined names (`of: define.k`): what in the case follows from them, and what is refused."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import Field, replace
from typing import Any, NamedTuple

import numpy as np

from mdstopo.case.arrays import FloatArray, FrozenDict
from mdstopo.case.design.following import Expressions, expressions_of
from mdstopo.case.design.movable import is_of_use
from mdstopo.case.keys.definitions import MARK, SECTION, is_kept_as_text
from mdstopo.case.laws.law import with_role
from mdstopo.case.model import MemberGroup
from mdstopo.case.objects.problem_parts import Following, Follows, Variable
from mdstopo.case.text.key_paths import stated_variables
from mdstopo.case.text.nodes import SCALAR, SEQUENCE, Node
from mdstopo.case.text.reading import Fields, Reading
from mdstopo.case.text.scalars import to_float
from mdstopo.case.text.words import did_you_mean, inside, listed, number_text, shown

#: what may follow from a name that varies
ALLOWED = "numbers of laws, places of grids of points that members end at, masses, loads and velocities at the start"
#: the sections whose numbers are masses, loads and velocities, or move the scene (`general.scene.numbers_of_scene`)
_SCENE = ("bodies", "gravity", "loads", "load_cases")
#: variables whose bounds are tried all with one another; of more, one after the other
TOGETHER = 8

#: names and places in lists that lead to a number
Steps = tuple[str | int, ...]


class _Written(NamedTuple):
    """An expression of the case: the way to it, its key path, its text."""

    steps: Steps
    key: str
    text: str


def build_named(name: str, fields: Fields, top: Fields, reading: Reading) -> Variable | None:
    """The design variable that a defined name is, before it is known what follows from it; None where there is none,
    which is noted."""
    word, path = fields["of"], fields.path
    numbers = top[SECTION] if isinstance(top[SECTION], dict) else {}
    if word not in numbers:
        hint = did_you_mean(word, numbers) or ";"
        there = f"there are {listed(numbers)}" if numbers else "nothing is defined"
        reading.mistake(inside(path, "of"), f"no name {shown(word)} stands in `define`{hint} {there}")
        return None
    initial = numbers[word]
    if not isinstance(initial, float):
        return None  # its mistake has been noted
    lower, upper = fields["lower"], fields["upper"]
    if not lower <= upper:
        message = f"found {number_text(lower)}, allowed is at most upper {number_text(upper)}"
        reading.mistake(inside(path, "lower"), message)
        return None
    if not lower <= initial <= upper:
        given = "" if "initial" in fields.stated else f" ({SECTION}.{word})"
        message = f"found {number_text(initial)}{given}, allowed is {number_text(lower)} to {number_text(upper)}"
        reading.mistake(inside(path, "initial"), message)
        return None
    return Variable(name, (), (), "", "case", 1, initial, lower, upper, fields["cost"], defined=word)


def build_follows(
    named: Sequence[Variable],
    written: Node,
    top: Fields,
    groups: dict[str, MemberGroup],
    taken: Mapping[tuple[str, int, str], str],
    reading: Reading,
) -> tuple[list[Variable], Follows | None]:
    """The variables that are defined names, and the numbers that follow from them; None where that is refused.

    named: the variables. written: the whole case with its expressions.
    top, groups: the case as read, and its groups by name.
    taken: by group, place of the law and parameter, the variables that parameters have of their own.
    reading: takes the mistakes.
    """
    owner = {each.defined: each for each in named}
    places = list(_expressions(written, (), ""))
    expressions = Expressions(tuple(owner), _given(written, owner), [each.text for each in places])
    classifier = _Classifier(owner, top, groups, taken, reading)
    numbers: list[Following] = []
    reaching: dict[str, list[Following]] = {word: [] for word in owner}
    good = True
    for k, place in enumerate(places):
        words = expressions.depends(k)
        if not words:
            continue
        number = classifier.following(place, words[0], expressions.jumps(k))
        if number is None:
            good = False
            continue
        numbers.append(number)
        for word in words:
            reaching[word].append(number)
            reading.followed[place.key] = owner[word].name
    for word, found in reaching.items():
        if good and not found:
            reading.mistake(_of(owner[word]), f"nothing in the case follows from {SECTION}.{word}")
            good = False
    given = {word: stated for word, stated in _given(written, owner).items() if word in expressions.used}
    follows = Follows(tuple(owner), tuple(numbers), FrozenDict(given))
    variables = [_reaching(each, reaching[each.defined], groups) for each in named]
    good = good and _are_within(variables, follows, groups, reading)
    return variables, (follows if good else None)


def _reaching(variable: Variable, numbers: Sequence[Following], groups: Mapping[str, MemberGroup]) -> Variable:
    """The variable with the groups that have numbers which follow from it, and the points that do."""
    grids = tuple(dict.fromkeys(each.grid for each in numbers if each.grid))
    ending = [group.name for group in groups.values() if {group.from_points, group.to_points} & set(grids)]
    reached = dict.fromkeys([*(each.group for each in numbers if each.group), *ending])
    return replace(variable, reached=tuple(reached), moved=grids)


def what_follows(written: Node) -> tuple[list[str], dict[str, float | str]]:
    """The key paths of what follows from names that are design variables, and all names that these lead to.

    written: a case that has been read, with its expressions; each name with what it stands for there.
    """
    words = [node.entries["of"][1].text.removeprefix(f"{SECTION}.") for node in stated_variables(written, "of")]
    if not words:
        return [], {}
    every = _given(written, ())
    places = list(_expressions(written, (), ""))
    expressions = Expressions(words, {w: v for w, v in every.items() if w not in words}, [each.text for each in places])
    keys = [place.key for k, place in enumerate(places) if expressions.depends(k)]
    return keys, {word: every[word] for word in every if word in (*words, *expressions.used)}


def laws_that_follow(written: Node, words: Sequence[str]) -> tuple[Expressions, list[tuple[str, int, str]], list[str]]:
    """The numbers of laws that are functions of some defined names: their expressions; group, law and parameter; key
    path.

    written: a case that has been read, with its expressions.
    """
    places = [each for each in _expressions(written, (), "") if each.steps[0] == "members" and "law" in each.steps[2:3]]
    every = {word: stated for word, stated in _given(written, ()).items() if word not in words}
    expressions = Expressions(words, every, [each.text for each in places])
    found = [(str(each.steps[1]), *_law_and_parameter(each)) for each in places]
    return expressions, found, [each.key for each in places]


def _law_and_parameter(place: _Written) -> tuple[int, str]:
    """Of a number of a law its place in the group's list of laws, and which number it is; nothing where it is none."""
    rest = [step for step in place.steps[3:] if step != "parameters"]
    law = int(rest.pop(0)) if rest and isinstance(rest[0], int) else 0
    return law, str(rest[0]) if len(rest) == 1 else ""


def _of(variable: Variable) -> str:
    return f"{inside('design.variables', variable.name)}.of"


def _expressions(node: Node, steps: Steps, path: str) -> Iterator[_Written]:
    """All expressions of a case but those in `define`, in the file's order."""
    if node.kind == SCALAR:
        text = node.scalar()
        if isinstance(text, str) and text.lstrip().startswith(MARK):
            yield _Written(steps, path, text.replace(MARK, " ", 1).strip())
    elif is_kept_as_text(path):
        return
    elif node.kind == SEQUENCE:
        for index, item in enumerate(node.items):
            yield from _expressions(item, (*steps, index), f"{path}[{index}]")
    else:
        for word, (_, value) in node.entries.items():
            if path or word not in (SECTION, "title"):
                yield from _expressions(value, (*steps, word), inside(path, word))


def _given(written: Node, variables: Collection[str]) -> dict[str, float | str]:
    """The defined names that do not vary, as they are written."""
    given: dict[str, float | str] = {}
    for word, (_, node) in written.entries[SECTION][1].entries.items():
        value = node.scalar() if node.kind == SCALAR else None
        if word in variables or isinstance(value, bool) or not isinstance(value, (int, float, str)):
            continue
        if not isinstance(value, str):
            given[word] = to_float(value)
            continue
        given[word] = value.replace(MARK, " ", 1) if value.lstrip().startswith(MARK) else value
    return given


class _Classifier:
    """Tells what an expression that a variable reaches is in the case, or why nothing is differentiated by it.

    owner: the variables by their names. top, groups: the case as read, and its groups by name.
    taken: by group, place of the law and parameter, the variables that parameters have of their own.
    reading: takes the mistakes.
    """

    def __init__(
        self,
        owner: Mapping[str, Variable],
        top: Fields,
        groups: dict[str, MemberGroup],
        taken: Mapping[tuple[str, int, str], str],
        reading: Reading,
    ) -> None:
        self._owner, self._top, self._groups, self._taken, self._reading = owner, top, groups, taken, reading
        #: grids that have been looked up, and whether their points may follow
        self._grids: dict[str, bool] = {}

    def following(self, place: _Written, word: str, jump: str) -> Following | None:
        """What an expression is in the case; None where nothing is differentiated by it, which is noted.

        place: the expression. word: the varied name that it depends on. jump: what in it jumps with that, or nothing.
        """
        number: Following | str
        if jump:
            number = f"by a jump, {jump}; allowed are kinks, as of max and clip"
        elif place.steps[0] == "members" and "law" in place.steps[2:3]:
            number = self._of_law(place)
        elif place.steps[0] == "points" and not {"count", "movable"} & set(place.steps):
            number = self._of_points(place, word)
        elif place.steps[0] in _SCENE:
            number = Following(place.key, place.text, "scene")
        else:
            number = f"and nothing is differentiated by it; what may follow are {ALLOWED}"
        if isinstance(number, str):
            if number:
                self._reading.mistake(_of(self._owner[word]), f"{place.key} follows from {SECTION}.{word}, {number}")
            return None
        return number

    def _of_law(self, place: _Written) -> Following | str:
        """A number of a law, or why it cannot follow."""
        group = self._groups[str(place.steps[1])]
        law, parameter = _law_and_parameter(place)
        record = group.laws[law]
        can = with_role(type(record), "varies")
        if parameter not in can:
            return f"by which no law of the type {record.type} is differentiated; there can be {listed(can)}"
        other = self._taken.get((group.name, law, parameter))
        if other is not None:
            return f"but {shown(other)} varies it already"
        return Following(place.key, place.text, "law", group.name, law, parameter)

    def _of_points(self, place: _Written, word: str) -> Following | str:
        """A number of places of points, or why they cannot follow; nothing where that has been told."""
        grid, stated = str(place.steps[1]), self._top["points"]
        if grid not in self._grids:
            movable = stated[grid]["movable"] is not None
            if movable:
                return "but these points are movable, so each has coordinates of its own already"
            self._grids[grid] = is_of_use(grid, _of(self._owner[word]), self._top, self._groups, self._reading)
        return Following(place.key, place.text, "points", grid=grid) if self._grids[grid] else ""


def _are_within(
    variables: Sequence[Variable], follows: Follows, groups: Mapping[str, MemberGroup], reading: Reading
) -> bool:
    """Whether what follows has values and slopes, and allowed ones, at the bounds of the variables; notes what has not.

    variables: of the names. follows: what follows from them. groups: by name. reading: takes the mistakes.
    """
    expressions = expressions_of(follows, follows.numbers)
    owner = {each.defined: each for each in variables}
    told: set[str] = set()
    for x in _corners(variables):
        at = dict(zip(owner, x.tolist(), strict=True))
        for k, (value, slope) in enumerate(zip(expressions.values(x).tolist(), expressions.slopes(x), strict=True)):
            number, words = follows.numbers[k], expressions.depends(k)
            wrong = ""
            if not np.isfinite(value):
                wrong = "has no finite value"
            elif not np.isfinite(slope).all():
                wrong = "has an infinite slope"
            elif number.kind == "law":
                field = type(groups[number.group].laws[number.law]).__dataclass_fields__[number.parameter]
                wrong = why_not_allowed(value, field)
            if wrong and number.key not in told:
                told.add(number.key)
                there = ", ".join(f"{word} = {number_text(at[word])}" for word in words)
                message = f"within the bounds, at {there}, {number.key} {wrong}"
                reading.mistake(inside("design.variables", owner[words[0]].name), message)
    return not told


def why_not_allowed(value: float, field: Field[Any]) -> str:
    """Why a parameter of a law may not be this number; empty where it may."""
    kind = field.metadata["kind"]
    above = field.metadata.get("varies_above", kind.above)
    low = (above is not None and value <= above) or (kind.minimum is not None and value < kind.minimum)
    if low or (kind.maximum is not None and value > kind.maximum):
        allowed = f"> {number_text(above)}" if above is not None else kind.allowed()
        return f"is {number_text(value)}, allowed is {allowed}"
    return ""


def _corners(variables: Sequence[Variable]) -> Iterator[FloatArray]:
    """Values (V,) at which all variables are at a bound, or where they are many each by itself."""
    bounds = [(each.lower, each.upper) for each in variables]
    if len(bounds) <= TOGETHER:
        for corner in itertools.product(*bounds):
            yield np.array(corner, dtype=np.float64)
        return
    start = np.concatenate([each.initials for each in variables])
    for i, pair in enumerate(bounds):
        for bound in pair:
            x = start.copy()
            x[i] = bound
            yield x
