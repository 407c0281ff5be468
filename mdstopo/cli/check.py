"""`mdstopo check`: what is in a case."""

import itertools
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.case.text.words import count_text
from mdstopo.cli.options import announce_compilation, case_argument, output_options, set_option
from mdstopo.cli.output import Output, number
from mdstopo.cli.uncertain_numbers import say_sample
from mdstopo.shown import counted

if TYPE_CHECKING:
    from mdstopo.case.model import Case
    from mdstopo.case.text.errors import CaseError
    from mdstopo.engine import Evaluator

_SOFT_BRANCH = (
    "A volume limit that need not be spent has a soft branch here: stored energy also falls when members",
    "are removed. Spend the volume (`equals`), or bound a displacement.",
)


@click.command("check")
@case_argument
@set_option
@output_options
def command(case_path: Path, overrides: dict[str, str], as_json: bool, quiet: bool) -> int:
    """Read a case and say what is in it: bodies, members, totals, natural frequencies.

    Nothing is optimised; one evaluation tells what each costs. What cannot be computed yet is listed with its place
    (exit status 2).
    """
    from mdstopo.case.text.errors import CaseError
    from mdstopo.scene.refusals import refusals

    output = Output(json=as_json, quiet=quiet)
    case = _read(output, case_path, overrides)
    refused = refusals(case)
    document = _say_stated(output, case, case_path)
    document["optimizable"] = case.is_optimizable and not refused
    document["refused"] = [mistake.located(str(case_path)) for mistake in refused]
    if not refused:
        document |= _say_computed(output, case)
    output.document(document)
    if refused:
        raise CaseError(refused, str(case_path))
    return 0


def _read(output: Output, case_path: Path, overrides: dict[str, str]) -> "Case":
    """The case; its mistakes are printed where it has some (CaseError)."""
    from mdstopo.case.reader import load_case
    from mdstopo.case.text.errors import CaseError

    try:
        return load_case(case_path, overrides)
    except CaseError as error:
        output.document(_mistaken(case_path, error))
        raise


def _say_stated(output: Output, case: "Case", case_path: Path) -> dict[str, Any]:
    """What the file states, without computing any motion: warnings, parts, totals, material."""
    from mdstopo.cli.check_numbers import material, totals
    from mdstopo.cli.check_scene import left_behind, odd_scales, unlike_partners

    for remark in case.warnings:
        output.notice(f"warning: {remark.located(str(case_path))}")
    questions = {
        "odd_scales": odd_scales(case),
        "left_behind": left_behind(case),
        "unlike_partners": unlike_partners(case),
    }
    for question in itertools.chain(*questions.values()):
        output.notice(f"warning: {question}")
    output.say(f"{case.title or case.name} ({case_path})")
    _say_bodies(output, case)
    _say_joints(output, case)
    _say_contacts(output, case)
    _say_members(output, case)
    _say_variables(output, case)
    _say_fit(output, case)
    stages = _say_stages(output, case)
    sums = totals(case)
    output.say("totals")
    output.table([[name, f"{number(value)} {unit}".rstrip()] for name, value, unit in sums])
    rows = material(case)
    if rows:
        output.say("material (Eq. 14)")
        output.table([["groups", "sense", "bound", "at start", "all at lower", "all at upper"], *rows])
    candidates = {each.name: each.candidates.count for each in case.priced_groups if each.candidates}
    return {
        "command": "check",
        "case": case.name,
        "title": case.title,
        "joints": [joint.name for joint in case.joints],
        "members": case.n_members,
        "design_variables": case.n_design,
        **({"candidates": candidates} if candidates else {}),
        "variables": {
            each.name: {"values": each.count, "initial": each.initials.tolist() if each.points else each.initial}
            for each in case.variables
        },
        **({"stages": stages} if stages else {}),
        **({"fit": [each.key for each in case.fit.numbers]} if case.fit is not None else {}),
        "totals": {name: {"value": value, "unit": unit} for name, value, unit in sums},
        "objectives": [objective.name for objective in case.objectives],
        **questions,
    }


def _say_computed(output: Output, case: "Case") -> dict[str, Any]:
    """What the engine tells: freedoms, frequencies, doubts, what is left out, and what an evaluation costs."""
    from mdstopo.cli.check_numbers import frequencies

    document: dict[str, Any] = {"uncertainty": say_sample(output, case)}
    _say_what_stays_open(output, case)
    announce_compilation(output, case)
    from mdstopo.evaluators import evaluator_of
    from mdstopo.session.compiling_apart import STEPS, compiling_in_background

    with compiling_in_background(case, STEPS):
        engine = evaluator_of(case, in_background=False)
        found = frequencies(case, engine)
        integrator = engine.integrator
    freedoms = {name: engine.degrees_of_freedom(name) for name in engine.scenes}
    for name, freedom in freedoms.items():
        output.say(f"load case {name}: {freedom} degrees of freedom")
        redundant = engine.scenes[name].redundant
        if redundant:
            output.say(f"load case {name}: joints with equations that follow from other joints: {', '.join(redundant)}")
    document["degrees_of_freedom"] = max(freedoms.values())
    for name in freedoms:
        rest = engine.settled(case.initial, name)
        if rest is not None:
            output.say(f"load case {name}: {rest}")
    _say_frequencies(output, case, found)
    document |= _say_doubts(output, case, engine)
    if engine.skipped:
        output.say("left out, because nothing asks for it")
    for sentence in engine.skipped:
        output.say(f"  {sentence}")
    output.table([["integrator", f"{integrator}: {engine.integrator_reason}"]], indent="")
    document |= {"frequencies": found, "skipped": engine.skipped, "integrator": integrator}
    document["evaluation"] = _say_cost(output, case, engine)
    return document


def _say_what_stays_open(output: Output, case: "Case") -> None:
    """Say before kernels are compiled, which takes a minute, what will not be known even then."""
    from mdstopo.cli.check_cost import NOT_COMPILED
    from mdstopo.warm import compilation_due

    if case.objectives and compilation_due(case):
        why = f"{NOT_COMPILED}; frequencies and freedoms need fewer"
        output.notice(f"what one evaluation costs will not be known: {why}")


def _say_cost(output: Output, case: "Case", engine: "Evaluator") -> dict[str, Any] | None:
    """What one evaluation will cost, where there are responses."""
    from mdstopo.cli.check_cost import cost, in_words

    found = cost(case, engine)
    if case.objectives:
        output.table([["one evaluation with gradients", in_words(found)]], indent="")
    return found


def _mistaken(case_path: Path, error: "CaseError") -> dict[str, Any]:
    """What is told of a case that cannot be read."""
    return {
        "command": "check",
        "case": case_path.stem,
        "mistakes": [
            {
                "key": mistake.path_key,
                "message": mistake.message,
                "line": mistake.line,
                "column": mistake.column,
                "origin": mistake.origin or str(case_path),
            }
            for mistake in error.mistakes
        ],
    }


def _say_doubts(output: Output, case: "Case", engine: "Evaluator") -> dict[str, Any]:
    """What nothing holds, what has no stiffness, and steps that are too long."""
    from mdstopo.cli.check_scene import in_words, long_step, restraint

    held, steps = {}, []
    for name, scene in engine.scenes.items():
        modes = engine.start_modes(case.start, name)
        held[name] = restraint(case, case.load_case(name), modes, scene.bodies)
        for sentence in in_words(held[name]):
            output.say(f"load case {name}: {sentence}")
        if too_long := long_step(case, modes, scene.bodies):
            steps.append(too_long)
            output.notice(f"warning: load case {name}: {too_long}")
    return {"restraint": held, "long_steps": steps}


def _say_bodies(output: Output, case: "Case") -> None:
    from mdstopo.cli.check_numbers import body_rows

    output.say(counted(len(case.bodies), "body"))
    output.table(body_rows(case))


def _say_joints(output: Output, case: "Case") -> None:
    if not case.joints:
        return
    rows = [["joint", "type", "between", "at, m"]]
    for joint in case.joints:
        at = ", ".join(number(value) for value in joint.at_first)
        rows.append([joint.name, joint.type, ", ".join(joint.bodies), f"({at}) on {joint.bodies[0]}"])
    output.say(counted(len(case.joints), "joint"))
    output.table(rows)


def _say_contacts(output: Output, case: "Case") -> None:
    """Which side of an edge is free is easily drawn the wrong way round: so it is told how deep points are in it."""
    if not case.contacts:
        return
    from mdstopo.case.model import SurfaceContact
    from mdstopo.cli.check_numbers import depths

    on_what = "on the edge of" if case.dimension == 2 else "on"
    rows = [["contact", "points of", on_what, "points", "in it at the start, m"]]
    for contact, own in zip(case.contacts, depths(case), strict=True):
        inside = f"{int((own > 0.0).sum())}, up to {number(float(own.max()))}" if (own > 0.0).any() else "none"
        on = contact.edge_body
        if isinstance(contact, SurfaceContact):
            on = f"the {contact.surface.shape} of {on}{', inside' if contact.surface.hollow else ''}"
        rows.append([contact.name, contact.body, on, str(len(own)), inside])
    output.say(counted(len(case.contacts), "contact"))
    output.table(rows)


def _say_members(output: Output, case: "Case") -> None:
    output.say(f"{case.n_members} members, {case.n_design} of them design variables")
    if not case.members:
        return
    for group in case.priced_groups:
        assert group.candidates is not None
        most = "at most " if group.candidates.filtered else ""
        output.say(
            f"{group.name}: {most}{count_text(group.candidates.count)} candidates, priced; "
            f"{count_text(len(group))} of them are members to begin with"
        )
    rows = [["group", "members", "between", "laws", "length, m", "cost", "alpha"]]
    for group in case.members:
        lengths = f"{number(group.length.min(), 4)} to {number(group.length.max(), 4)}" if len(group) else "-"
        design = f"{number(group.initial)} in {number(group.lower)} to {number(group.upper)}"
        rows.append(
            [
                group.name,
                str(len(group)),
                f"{group.body_from}, {group.body_to}",
                " + ".join(law.type for law in group.laws),
                lengths,
                number(float(group.cost.sum())),
                design if group.design else "1 (no variable)",
            ]
        )
    output.table(rows)


def _say_stages(output: Output, case: "Case") -> list[dict[str, float]]:
    """The powers of each stage that a run goes through, by group; nothing where there is one."""
    from mdstopo.case.design.stages import stage_case, stage_count

    count = stage_count(case)
    if count == 1:
        return []
    stages = [{group.name: group.power for group in stage_case(case, k).design_groups} for k in range(count)]
    output.say(f"{count} stages of a run, by design.power")
    rows = [[str(k + 1), *(number(power) for power in powers.values())] for k, powers in enumerate(stages)]
    output.table([["stage", *stages[0]], *rows])
    return stages


def _say_variables(output: Output, case: "Case") -> None:
    """What is shared, and the parameters of laws that vary."""
    together = [f"shared: {name}" for name in case.shared]
    together += [f"mirrored: {', '.join(names)}" for names in case.mirrored]
    if together:
        output.say(f"{case.space.size - case.space.length + case.n_design} different alphas; {'; '.join(together)}")
    if not case.variables:
        return
    from mdstopo.cli.show import values_text

    kinds = {
        "values of laws": any(each.groups for each in case.variables),
        "defined names": any(each.defined for each in case.variables),
        "coordinates of points": bool(case.movable),
    }
    what = " and ".join(kind for kind, there in kinds.items() if there)
    output.say(f"{case.space.length - case.n_design} {what} that vary")
    rows = [["variable", "of", "values", "initial", "lower", "upper", "unit", "cost"]]
    for each in case.variables:
        numbers = (
            values_text(each.initials) if each.points else number(float(each.initial)),
            number(each.lower),
            number(each.upper),
        )
        rows.append([each.name, each.of, str(each.count), *numbers, each.unit, number(each.cost)])
    output.table(rows)


def _say_fit(output: Output, case: "Case") -> None:
    """What `mdstopo fit` estimates, and of which measurements."""
    if case.fit is None:
        return
    from mdstopo.case.responses.response_units import words

    output.say(f"{len(case.fit.numbers)} numbers to fit")
    rows = [["number", "initial", "lower", "upper"]]
    for each in case.fit.numbers:
        of = each.range
        rows.append([each.key, number(of.initial), number(of.lower), number(of.upper)])
    output.table(rows)
    output.table(
        [["series", "file", "what", "load case"]]
        + [[each.name, each.file, words(each.response), each.load_case] for each in case.fit.series]
    )


def _frequency_rows(entry: dict[str, Any]) -> list[list[str]]:
    """The table of the natural frequencies of one load case, with modes of negative stiffness where there are some."""
    grow = any(entry["growing"].values())
    rows = [["design", "omega, rad/s", "omega t1", *(["growing, 1/s"] if grow else [])]]
    for design in ("initial", "lower"):
        values = entry[design]
        rows.append(
            [
                design,
                ", ".join(number(value, 4) for value in values) or "none",
                ", ".join(number(value * entry["duration"], 4) for value in values) or "-",
            ]
        )
        if grow:
            rows[-1].append(", ".join(number(rate, 4) for rate in entry["growing"][design]) or "none")
    return rows


def _alike(found: list[dict[str, Any]]) -> list[tuple[dict[str, Any], list[str]]]:
    """The first of the load cases with the same table and duration, with the names of all of them."""
    groups: dict[str, tuple[dict[str, Any], list[str]]] = {}
    for entry in found:
        told = f"{number(entry['duration'])} {_frequency_rows(entry)}"
        groups.setdefault(told, (entry, []))[1].append(entry["load_case"])
    return list(groups.values())


def _say_frequencies(output: Output, case: "Case", found: list[dict[str, Any]]) -> None:
    # on which side of the criterion a case stands is a question of stored energy alone
    from mdstopo.case.responses.response_kinds import kind_of

    energetic = {objective.load_case for objective in case.objectives if kind_of(objective.response).is_energy}
    for entry, names in _alike(found):
        cases = "load case" if len(names) == 1 else "load cases"
        output.say(
            f"natural frequencies at the start, {cases} {', '.join(names)}, "
            f"times the duration {number(entry['duration'])} s"
        )
        output.table(_frequency_rows(entry))
        if entry["criterion"] is not None and not energetic.isdisjoint(names):
            verdict = "> 4: more stiffness lowers the energy" if entry["criterion"] > 4.0 else "<= 4"
            output.say(f"  omega(initial) omega(lower bounds) t1^2 = {number(entry['criterion'], 4)} {verdict}")
            if entry["criterion"] <= 4.0:
                for sentence in _SOFT_BRANCH:
                    output.say(f"  {sentence}")
