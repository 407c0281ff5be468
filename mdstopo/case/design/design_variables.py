"""What varies besides each member's own alpha: alphas that are one, parameters of laws, names (`design_space`)."""

from __future__ import annotations

from dataclasses import Field
from typing import Any

from mdstopo.case.keys.kinds import Number
from mdstopo.case.laws.law import with_role
from mdstopo.case.model import Follows, Law, MemberGroup, Variable
from mdstopo.case.scene.candidates import unlike
from mdstopo.case.text.nodes import Node
from mdstopo.case.text.reading import BAD, Fields, Reading
from mdstopo.case.text.words import inside, listed, number_text, shown


def varying(law: Law) -> tuple[str, ...]:
    """The parameters of a law by which the engine differentiates."""
    return with_role(type(law), "varies")


def build_shared(top: Fields, groups: dict[str, MemberGroup] | None, reading: Reading) -> dict[str, Any]:
    """The parts `shared` and `mirrored` of the case; groups: None where members could not be read."""
    design = top["design"]
    nothing: dict[str, Any] = {"shared": (), "mirrored": ()}
    if design is BAD or design is None or groups is None or not design.good("shared", "mirrored"):
        return nothing
    path = inside(design.path, "shared")
    good = _are_design(design["shared"], path, groups, reading)
    place = inside(design.path, "mirrored")
    joined: list[set[str]] = []
    for i, names in enumerate(design["mirrored"]):
        own = f"{place}[{i}]"
        if not _are_design(names, own, groups, reading):
            good = False
            continue
        for name in names[1:]:
            if any(groups[each].candidates is not None for each in (names[0], name)):
                message = unlike(groups[names[0]], groups[name])
                if message:
                    reading.mistake(own, f"{shown(names[0])} and {shown(name)} cannot be priced together: {message}")
                    good = False
        counts = [len(groups[name]) for name in names]
        if len(set(counts)) > 1:
            told = ", ".join(f"{name} has {count:,}" for name, count in zip(names, counts, strict=True))
            reading.mistake(own, f"{told}; member k of one goes with member k of the other: equal counts are needed")
            good = False
        # what earlier lists tie to one of these counts, too
        tied = set(names).union(*(each for each in joined if each & set(names)))
        joined = [each for each in joined if not each & tied] + [tied]
        low, high = max(groups[name].lower for name in tied), min(groups[name].upper for name in tied)
        if low > high:
            message = f"their bounds have nothing in common: lower {number_text(low)}, upper {number_text(high)}"
            if len(tied) > len(names):
                message += f" (of {listed(sorted(tied))})"
            reading.mistake(own, message)
            good = False
    return {"shared": tuple(design["shared"]), "mirrored": tuple(map(tuple, design["mirrored"]))} if good else nothing


def _are_design(names: list[str], path: str, groups: dict[str, MemberGroup], reading: Reading) -> bool:
    """Whether all are groups with variables, none of them named twice."""
    good = all(name in groups for name in names)
    for i, name in enumerate(names):
        if name in names[:i]:
            reading.mistake(f"{path}[{i}]", f"{shown(name)} is in the list already")
            good = False
        elif name in groups and not groups[name].design:
            reading.mistake(f"{path}[{i}]", f"{shown(name)} has `design: false`: its alpha is 1 and no variable")
            good = False
    return good


def build_variables(
    top: Fields, groups: dict[str, MemberGroup] | None, written: Node, reading: Reading
) -> tuple[tuple[Variable, ...], Follows | None]:
    """The variables that can be made, in the file's order, and what follows from those that are defined names.

    written: the whole case with its expressions.
    """
    design = top["design"]
    sections = design["variables"] if isinstance(design, Fields) else None
    if not isinstance(sections, dict) or groups is None:
        return (), None
    built: list[Variable] = []
    follows: Follows | None = None
    taken: dict[tuple[str, int, str], str] = {}
    for name, fields in sections.items():
        if fields is BAD or not fields.good():
            continue
        variable = _build(name, fields, top, groups, reading)
        if variable is None:
            continue
        twin = next((each.name for each in built if each.defined and each.defined == variable.defined), None)
        if twin is not None:
            reading.mistake(inside(fields.path, "of"), f"define.{variable.defined} is varied by {shown(twin)} already")
            continue
        for group, law in zip(variable.groups, variable.laws, strict=True):
            other = taken.setdefault((group, law, variable.parameter), name)
            if other != name:
                message = f"{variable.parameter} of {group!r} is varied by {shown(other)} already"
                reading.mistake(inside(fields.path, "parameter"), message)
        built.append(variable)
    named = [each for each in built if each.defined]
    if named:
        from mdstopo.case.design.named_variables import build_follows  # most cases have none

        found, follows = build_follows(named, written, top, groups, taken, reading)
        by_name = {each.name: each for each in found}
        built = [by_name.get(each.name, each) for each in built]
    if isinstance(top["objectives"], dict) and "variables" in top["objectives"]:
        message = "this name is taken where there are design.variables: results keep the derivatives by them under it"
        reading.mistake("objectives.variables", message)
    return tuple(built), follows


def _build(name: str, fields: Fields, top: Fields, groups: dict[str, MemberGroup], reading: Reading) -> Variable | None:
    if fields["of"] is not None:
        from mdstopo.case.design.named_variables import build_named  # most cases have none

        return build_named(name, fields, top, reading)
    stated = fields["group"]
    if fields["parameter"] is None:
        return None  # it is missing, which has been noted
    names = [stated] if isinstance(stated, str) else list(stated)
    if not all(group in groups for group in names):
        return None
    path, parameter = fields.path, fields["parameter"]
    repeated = [group for i, group in enumerate(names) if group in names[:i]]
    if repeated:
        reading.mistake(inside(path, "group"), f"{shown(repeated[0])} is in the list twice")
        return None
    laws = [_law(groups[group], fields, reading) for group in names]
    if any(law is None for law in laws):
        return None
    records = [groups[group].laws[law or 0] for group, law in zip(names, laws, strict=True)]
    counts = [len(groups[group]) for group in names]
    if fields["each"] == "member" and len(set(counts)) > 1:
        told = ", ".join(f"{group} has {count:,}" for group, count in zip(names, counts, strict=True))
        reading.mistake(inside(path, "each"), f"{told}; member k of each has the same value: equal counts are needed")
        return None
    initial = fields["initial"]
    if initial is None:
        own = {getattr(record, parameter) for record in records}
        if len(own) > 1 or None in own:
            why = "differ" if len(own) > 1 else "do not say it"
            reading.mistake(path, f"the key 'initial' is missing, and the laws {why} (the first value of {parameter})")
            return None
        initial = own.pop()
    field = type(records[0]).__dataclass_fields__[parameter]
    if not _within(fields, initial, field, reading):
        return None
    return Variable(
        name, tuple(names), tuple(law or 0 for law in laws), parameter, fields["each"],
        counts[0] if fields["each"] == "member" else 1, initial, fields["lower"], fields["upper"], fields["cost"],
        field.metadata["unit"],
    )  # fmt: skip


def _law(group: MemberGroup, fields: Fields, reading: Reading) -> int | None:
    """The place of the law that is meant, of those of a group."""
    parameter, stated = fields["parameter"], fields["law"]
    having = [i for i, law in enumerate(group.laws) if parameter in varying(law)]
    if stated is None:
        if len(having) == 1:
            return having[0]
        if having:
            which = listed(map(str, having))
            message = f"several laws of {group.name!r} have {parameter}: say which with `law`, one of {which}"
            reading.mistake(inside(fields.path, "parameter"), message)
            return None
    elif stated >= len(group.laws):
        there = f"0 to {len(group.laws) - 1}" if len(group.laws) > 1 else "0 alone"
        reading.mistake(inside(fields.path, "law"), f"found {stated}, {group.name!r} has {there}")
        return None
    elif stated in having:
        return int(stated)
    asked = group.laws if stated is None else (group.laws[stated],)
    types = listed(law.type for law in asked)
    can = dict.fromkeys(name for law in asked for name in varying(law))
    reading.mistake(
        inside(fields.path, "parameter"),
        f"found {shown(parameter)}, which can be varied in no law of {group.name!r} ({types}); "
        f"there can be {listed(can) or 'none'}",
    )
    return None


def _within(fields: Fields, initial: float, field: Field[Any], reading: Reading) -> bool:
    """Whether bounds and start go together, and with what the law allows; notes what does not."""
    good = True
    kind = field.metadata["kind"]
    above = field.metadata.get("varies_above", kind.above)
    lower, upper = fields["lower"], fields["upper"]
    if (above is not None and lower <= above) or (kind.minimum is not None and lower < kind.minimum):
        allowed = Number(above=above).allowed() if above is not None else kind.allowed()
        reading.mistake(inside(fields.path, "lower"), f"found {number_text(lower)}, {field.name} is {allowed}")
        good = False
    if lower > upper:
        message = f"found {number_text(lower)}, allowed is at most upper {number_text(upper)}"
        reading.mistake(inside(fields.path, "lower"), message)
        good = False
    elif not lower <= initial <= upper:
        given = "" if "initial" in fields.stated else " (the law's own)"
        message = f"found {number_text(initial)}{given}, allowed is {number_text(lower)} to {number_text(upper)}"
        reading.mistake(inside(fields.path, "initial"), message)
        good = False
    return good
