"""Every kind of mistake is found, at its place, with its key, what was found and what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest

from mdstopo.case.reader import load_case, read_case
from mdstopo.case.text.errors import CaseError

from .scenes import EVERYTHING, SMALL, changed, mistakes, place

# (what is replaced, by what, at which part the mistake stands, its key, words of its message)
SPRING = "stiffness: 225"
ONE = [
    (SPRING, "stifness: 225", "stifness", "members.belts.law.stifness", ["'stifness'", "'stiffness'",
     "damping"]),
    (SPRING, "stiffness: -5", "-5", "members.belts.law.stiffness", ["-5", ">= 0"]),
    (SPRING, "stiffness: .nan", ".nan", "members.belts.law.stiffness", [".nan", "finite"]),
    (SPRING, "stiffness: -.INF", "-.INF", "members.belts.law.stiffness", ["-.INF", "finite"]),
    (SPRING, "stiffness: 1e999", "1e999", "members.belts.law.stiffness", ["1e999", "finite"]),
    (SPRING, 'stiffness: "225"', '"225"', "members.belts.law.stiffness", ["'225'", "quoted"]),
    (SPRING, "stiffness: 225 N/m", "225 N", "members.belts.law.stiffness", ["'225 N/m'", "SI", "in quotes"]),
    (SPRING, "stiffness: true", "true", "members.belts.law.stiffness", ["true", "number"]),
    (SPRING, "stiffness: [1]", "[1]", "members.belts.law.stiffness", ["list of 1", "number"]),
    (SPRING, "stiffness: ", "}}", "members.belts.law.stiffness", ["nothing", "number"]),
    (SPRING, "damping: 1", "{type", "members.belts.law", ["'stiffness'", "missing"]),
    (SPRING, "stiffness: 1, free_length: -1", "-1}", "members.belts.law.free_length", [">= 0"]),
    (SPRING, "stiffness: 1, gap: 1", "gap", "members.belts.law.gap", ["unknown key 'gap'"]),
    (SPRING, "stiffness: 1e308", "1e308", "members.belts.law.stiffness", ["too large"]),
    ("mass: 2,", "mass: 2 kg,", "2 kg", "bodies.a.mass", ["'2 kg'", "> 0"]),
    ("type: spring", "type: sprong", "sprong", "members.belts.law.type", ["'sprong'", "'spring'", "inerter"]),
    ("type: spring, ", "", "{stiff", "members.belts.law", ["'type'", "missing", "spring"]),
    ("type: spring", "typ: spring", "typ:", "members.belts.law.typ", ["'typ'", "'type'"]),
    ("law: {type: spring, stiffness: 225}", "law: spring", "spring", "members.belts.law", ["'spring'",
     "law"]),
    ("mass: 2,", "mass: 0,", "0,", "bodies.a.mass", ["found 0", "> 0"]),
    ("mass: 2, ", "", "{inertia", "bodies.a", ["'mass'", "missing"]),
    ("position: [0, 0]", "position: [0]", "[0]", "bodies.a.position", ["list of 1", "list of 2"]),
    ("position: [0, 0]", "position: [0, x]", "x]", "bodies.a.position[1]", ["'x'", "number"]),
    ("position: [0, 0]", "position: 0", "0}", "bodies.a.position", ["found 0", "list of 2"]),
    ("inertia: 3", "inertia: 1e308", "1e308", "bodies.a.inertia", ["1e+308", "extreme"]),
    ("position: [0, 0]", "position: [1e200, 0]", "[1e200", "bodies.a.position", ["too large"]),
    ("  a:", "  ground: {mass: 1, inertia: 1, position: [0, 0]}\n  a:", "ground", "bodies.ground", ["taken"]),
    ("format: 1", "format: 2", "2", "format", ["found 2", "allowed is 1"]),
    ("format: 1", "format: '1'", "'1'", "format", ["'1'", "allowed is 1"]),
    ("end: 0.2", "end: 0", "0}", "time.end", ["found 0", "after start 0"]),
    ("end: 0.2", "end: 0.2, start: 0.3", "0.2", "time.end", ["after start 0.3"]),
    ("{end: 0.2}", "{}", "{}", "time", ["'end'", "missing"]),
    ("{end: 0.2}", "0.2", "0.2", "time", ["found 0.2", "mapping"]),
    ("from: p", "from: P", "P,", "members.belts.from", ["'P'", "'p'"]),
    ("from: p", "from: q", "{from", "members.belts", ["both ends", "'b'"]),
    ("from: p", "from: {body: a, at: [2, 1]}", "{from", "members.belts", ["zero length", "1 of"]),
    ("from: p", "from: {body: a}", "{body: a}", "members.belts.from", ["'at'", "missing"]),
    ("from: p, ", "", "{to", "members.belts", ["'from'", "missing"]),
    ("to: q", "to: q, connect: pairs", "pairs", "members.belts.connect", ["2 points", "3", "equal"]),
    ("to: q", "to: q, connect: pair", "pair,", "members.belts.connect", ["'pair'", "'pairs'", "all"]),
    ("to: q", "to: q, max_length: 1", "{from", "members.belts", ["no member", "2 to 2.828 m apart"]),
    ("to: q", "to: q, min_length: 3, max_length: 1", "1,", "members.belts.max_length", ["min_length 3"]),
    ("to: q", "to: q, cost: -1", "-1", "members.belts.cost", ["-1", ">= 0"]),
    ("to: q", "to: q, cost: lenght", "lenght", "members.belts.cost", ["'lenght'", "'length'", "number"]),
    ("to: q", "to: q, design: no", "no,", "members.belts.design", ["'no'", "true or false"]),
    ("body: a, grid", "body: aa, grid", "aa", "points.p.body", ["'aa'", "'a'", "ground"]),
    ("{list: [[0, 0], [0, 1]]}", "{lisst: 3}", "lisst", "points.p.grid.lisst", ["'list'", "lattice"]),
    ("{list: [[0, 0], [0, 1]]}", "{}", "{}", "points.p.grid", ["exactly one of", "circle"]),
    ("{list: [[0, 0], [0, 1]]}", "[]", "[]", "points.p.grid", ["empty list", "1"]),
    ("[0, 0], [0, 1]]", "[0, 0], [0]]", "[0]]", "points.p.grid.list[1]", ["list of 1", "[x, y]"]),
    ("[0, 0], [0, 1]]", "[0, 0], [0, .inf]]", ".inf", "points.p.grid.list[1][1]", [".inf", "finite"]),
    ("[[0, 0], [0, 1]]", "{file: no.csv}", "no.csv", "points.p.grid.list.file", ["no file", "no.csv"]),
    ("[[0, 0], [0, 1]]", "{file: /}", "/", "points.p.grid.list.file", ["folder"]),
    ("{body: b, force", "{body: ground, force", "ground, f", "loads[0].body", ["ground does not move"]),
    ("force: [1, 0]", "at: [0, 0]", "{body: b, at", "loads[0]", ["at least one of", "moment"]),
    ("force: [1, 0]", "force: [1, 0], acceleration: [0, 1]", "{body: b, f", "loads[0]", ["force",
     "one of them"]),
    ("force: [1, 0]", "force: {table: []}", "[]", "loads[0].force.table", ["0 rows"]),
    ("force: [1, 0]", "force: {table: [[0, 1]]}", "[0, 1]]", "loads[0].force.table[0]", ["[t, fx, fy]"]),
    ("force: [1, 0]", "moment: [[1, 0], [0, 1]]", "[0, 1]]}", "loads[0].moment[1]", ["0 after 1", "fall"]),
    ("force: [1, 0]", "moment: [[0, 0], [0, 1], [0, 2]]", "[0, 2]", "loads[0].moment[2]", ["two rows"]),
    ("force: [1, 0]", "moment: abc", "abc", "loads[0].moment", ["'abc'", "table"]),
    ("force: [1, 0]", "acceleration: [1e308, 0]", "[1e308", "loads[0].acceleration", ["too large"]),
    ("force: [1, 0]", "frame: local, moment: 1", "local", "loads[0].frame", ["'local'", "global | body"]),
    ("response: energy", "response: enrgy", "enrgy", "objectives.G.response", ["'enrgy'", "'energy'"]),
    ("response: energy", "response: {}", "{}}", "objectives.G.response", ["exactly one of", "angle"]),
    ("response: energy", "response: energy, sense: max", "max", "objectives.G.sense",
     ["minimize | maximize"]),
    ("response: energy", "response: energy, load_case: x", "x}", "objectives.G.load_case", ["no load case"]),
    ("response: energy", "response: {angle: {body: a, relative_to: a}}", "a}}",
     "objectives.G.response.angle.relative_to", ["itself"]),
    ("response: energy", "response: {member_force: {group: belt}}", "belt}",
     "objectives.G.response.member_force.group", ["'belt'", "'belts'"]),
    ("response: energy", "response: {joint_force: {joint: 0}}", "0}",
     "objectives.G.response.joint_force.joint", ["'0'", "no joint"]),
    ("  G: {response: energy}", "  G: {response: energy}\n  H: {response: energy}", "objectives",
     "objectives", ["combine"]),
    ("equals: 3", "equals: 7", "7}", "constraints[0].equals", ["7", "upper", "6"]),
    ("equals: 3", "equals: 0.005", "0.005", "constraints[0].equals", ["0.005", "lower", "0.006"]),
    ("equals: 3", "limit: -1", "-1", "constraints[0].limit", ["-1", "lower"]),
    ("equals: 3", "at_least: 7", "7}", "constraints[0].at_least", ["7", "upper"]),
    ("equals: 3", "fraction: 1e-9", "1e-9", "constraints[0].fraction", ["lower"]),
    ("equals: 3", "equals: 3, limit: 4", "{volume", "constraints[0]", ["limit and equals", "exactly one"]),
    (", equals: 3", "", "{volume", "constraints[0]", ["exactly one of limit"]),
    ("equals: 3", "at_most: 3", "at_most", "constraints[0].at_most", ["'at_most': an upper bound is `limit`"]),
    ("volume: all", "volume: [belts, belts]", "belts]", "constraints[0].volume[1]", ["already"]),
    ("volume: all", "volume: al", "al,", "constraints[0].volume",
     ["'al', did you mean 'all'? there are belts; or all"]),
    ("equals: 3", "equals: 3, over_time: max", "max}", "constraints[0].over_time", ["'response'"]),
    ("equals: 3", "fraction: 1.2", "1.2", "constraints[0].fraction", ["1.2", "<= 1"]),
    ("volume: all, equals: 3", "response: energy, fraction: 0.3", "0.3}", "constraints[0].fraction", ["'volume'"]),
    ("equals: 3}", "equals: 3}\n  - {volume: belts, at_least: 4}", "4}", "constraints[1].at_least",
     ["only 3"]),
    ("objectives:", "design: {lower: 0.2}\nobjectives:", "{lower", "design.initial", ["default",
     "lower 0.2"]),
    ("objectives:", "design: {initial: 0.9, upper: 0.5}\nobjectives:", "0.9", "design.initial",
     ["upper 0.5"]),
    ("objectives:", "design: {upper: 1.5}\nobjectives:", "1.5", "design.upper", ["<= 1"]),
    ("objectives:", "design: {lower: -1}\nobjectives:", "-1", "design.lower", [">= 0"]),
    ("objectives:", "design: {lower: 0.6, upper: 0.5}\nobjectives:", "0.6", "design.lower", ["above upper"]),
    ("objectives:", "design: {power: 0}\nobjectives:", "0}\nobj", "design.power", ["> 0"]),
    ("objectives:", "design: {power: 0.5, lower: 0}\nobjectives:", "0}\nobj", "design.lower",
     ["> 0 where power"]),
    ("objectives:", "design: {initial: {belt: 1}}\nobjectives:", "1}}", "design.initial.belt", ["'belts'"]),
    ("objectives:", "optimizer: {max_iterations: 1.5}\nobjectives:", "1.5", "optimizer.max_iterations",
     ["whole"]),
    ("objectives:", "optimizer: {peak: 2}\nobjectives:", "peak", "optimizer.peak", ["'peaks'"]),
    ("objectives:", "optimizer: {peaks: 0}\nobjectives:", "0}\nobj", "optimizer.peaks", [">= 1"]),
    ("objectives:", "solver: {step: 0}\nobjectives:", "0}\nobj", "solver.step", ["> 0"]),
    ("objectives:", "solver: {step: 1e-12}\nobjectives:", "1e-12", "solver.step", ["steps"]),
    ("objectives:", "solver: {step: 10, integrator: generalized_alpha}\nobjectives:", "10, int", "solver.step",
     ["found 10", "longer than the motion", "0.2 s"]),
    ("objectives:", "solver: {step: 0.2001}\nobjectives:", "0.2001", "solver.step", ["longer than the motion"]),
    ("objectives:", "solver: {tolerance: 0}\nobjectives:", "0}\nobj", "solver.tolerance", ["> 0"]),
    ("objectives:", "solver: {spectral_radius: 1.1}\nobjectives:", "1.1", "solver.spectral_radius", ["<= 1"]),
    ("objectives:", "solver: {sensitivity: iterative, integrator: gauss}\nobjectives:", "iterative",
     "solver.sensitivity", ["gauss", "generalized_alpha"]),
    ("objectives:", "solver: {integrator: runge_kutta, sensitivity: iterative}\nobjectives:", "iterative",
     "solver.sensitivity", ["runge_kutta"]),
    ("loads:", "joints: [{type: revolute, bodies: [a, a], at: [0, 0]}]\nloads:", "[a, a]", "joints[0].bodies",
     ["'a' twice"]),
    ("loads:", "joints: [{type: prismatic, bodies: [a, b], at: [0, 0], axis: [0, 0]}]\nloads:", "[0, 0]}]\nl",
     "joints[0].axis", ["zero vector"]),
    ("loads:", "joints: [{type: distance, bodies: [a, b], at: [[1, 0], [1, 0]]}]\nloads:", "[[1, 0]",
     "joints[0].at", ["coincide"]),
    ("loads:", "joints: [{type: revolute, bodies: [a, b], at: {a: [0, 0]}}]\nloads:", "{a: [0, 0]}",
     "joints[0].at", ["point on b"]),
    ("loads:", "joints: [{type: revolute, bodies: [a, b]}]\nloads:", "{type: rev", "joints[0]", ["'at'"]),
    ("loads:", "bushings: [{bodies: [a, b], at: [0, 0], stiffness: [1, -1, 1]}]\nloads:", "-1, 1",
     "bushings[0].stiffness[1]", [">= 0"]),
    ("loads:", "motions: [{body: ground, x: {velocity: 1}}]\nloads:", "ground", "motions[0].body",
     ["ground"]),
    ("loads:", "motions: [{body: a}]\nloads:", "{body: a}", "motions[0]", ["at least one of x, y, angle"]),
    ("loads:", "motions: [{body: a, x: {}}]\nloads:", "{}}]", "motions[0].x", ["exactly one of"]),
    ("loads:", "motions: [{body: a, x: {position: 3}}]\nloads:", "3}}]", "motions[0].x.position", ["table"]),
    ("loads:", "motions: [{body: a, x: {position: [[0, 0], [1, 1], [2, 2]]}}]\nloads:", "[[0, 0], [1, 1]",
     "motions[0].x.position", ["3 rows", "4"]),
    ("loads:", "motions: [{body: a, x: {position: [[0, 0], [1, 1], [1, 1], [2, 2]]}}]\nloads:", "[1, 1], [2",
     "motions[0].x.position[2]", ["larger"]),
    ("loads:", "motions: [{body: a, x: {position: [[0, 0], [.1, 0], [.15, 0], [.19, 0]]}}]\nloads:",
     "[[0, 0], [.1",
     "motions[0].x.position", ["0.19", "cover", "0.2"]),
    ("loads:", "motions: [{body: a, x: {position: [[0, 1], [.1, 1], [.15, 1], [.2, 1]]}}]\nloads:",
     "[[0, 1], [.1",
     "motions[0].x.position", ["1 at the start", "states 0"]),
    ("loads:", "load_cases: {one: {time: {end: -1}}}\nloads:", "-1", "load_cases.one.time.end",
     ["after start 0"]),
    ("loads:", "load_cases: {default: {}}\nloads:", "default", "load_cases.default", ["taken"]),
    ("loads:", "load_cases: {1x: {}}\nloads:", "1x", "load_cases.'1x'", ["letter"]),
    ("loads:", "laods: []\nloads:", "laods", "laods", ["unknown key 'laods'"]),
    ("loads:", "? [a]\n: b\nloads:", "[a]", "", ["key"]),
    ("loads:", "title: 12\nloads:", "12\n", "title", ["quote"]),
    ("loads:", "time: {end: 3}\nloads:", "time: {end: 3}", "time", ["twice", "line 2, column 1"]),
    ("mass: 2,", "mass: 2, mass: 3,", "mass: 3", "bodies.a.mass", ["twice", "line 4, column 7"]),
    ("mass: 2,", "mass: !!float 2,", "!!float", "bodies.a.mass", ["tag"]),
    ("mass: 2,", "mass: !thing 2,", "!thing", "bodies.a.mass", ["tag", "!thing"]),
    ("mass: 2,", "<<: 3, mass: 2,", "3, mass", "bodies.a", ["merge"]),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "at", "key", "words"), ONE, ids=[f"{i}-{c[3]}" for i, c in enumerate(ONE)])
def test_a_single_mistake_is_told_once_with_place_key_found_and_allowed(
    old: str, new: str, at: str, key: str, words: list[str]
) -> None:
    text = changed(SMALL, (old, new))
    (mistake,) = mistakes(text)
    line_start = SMALL.rfind("\n", 0, SMALL.index(old)) + 1
    index = text.find(at, line_start)
    before = text[: index if index >= 0 else text.index(at)]
    assert (mistake.line, mistake.column) == (before.count("\n") + 1, len(before) - before.rfind("\n"))
    assert mistake.path_key == key
    for word in words:
        assert word in mistake.message


def test_a_fixed_step_has_to_fit_the_shortest_load_case() -> None:
    cases = "solver: {step: 0.15}\nload_cases: {one: {}, two: {time: {end: 0.1}}}\nobjectives:"
    text = changed(SMALL, ("objectives:", cases), ("response: energy", "response: energy, load_case: one"))
    (mistake,) = mistakes(text)
    assert mistake.path_key == "solver.step"
    assert "found 0.15: longer than the shortest load case, which takes 0.1 s" in mistake.message


@pytest.mark.parametrize(
    ("solver", "words"),
    [
        ("step: 0.2, integrator: generalized_alpha", "one step of generalized_alpha for 0.2 s"),
        ("step: 0.1, sensitivity: iterative", "2 steps of generalized_alpha for 0.2 s"),
        ("step: 0.0134, integrator: generalized_alpha", "15 steps of generalized_alpha"),
        ("step: 0.0125, integrator: generalized_alpha", None),
        ("step: 0.2, integrator: gauss", None),
    ],
)
def test_so_few_fixed_steps_that_they_hardly_tell_the_motion_are_warned_of(solver: str, words: str | None) -> None:
    case = read_case(changed(SMALL, ("objectives:", f"solver: {{{solver}}}\nobjectives:")))
    found = [each for each in case.warnings if each.path_key == "solver.step"]
    assert [words in each.message for each in found] == ([] if words is None else [True])


def test_all_mistakes_are_told_together_sorted_by_place() -> None:
    text = changed(
        EVERYTHING,
        ("mass: 60", "mass: -60"),
        ("size: [0.5, 0.5]", "size: [0.5, 0]"),
        ("peak: -3", "peek: -3"),
        ("type: inerter", "type: inerta"),
        ("body: b, at: [0, 0]", "body: bb, at: [0, 0]"),
        ("max_iterations: 100", "max_iterations: many"),
    )
    found = mistakes(text)
    assert [m.path_key for m in found] == [
        "bodies.a.mass",
        "points.edge.grid.rectangle.size[1]",
        "members.single.law[3].peek",
        "members.single.law[6].type",
        "objectives.G2.response.displacement.body",
        "optimizer.max_iterations",
    ]
    assert [(m.line, m.column) for m in found] == sorted((m.line, m.column) for m in found)


def test_the_text_of_the_error_is_one_line_for_each_mistake() -> None:
    text = changed(SMALL, ("mass: 2,", "mass: -2,"), ("inertia: 5", "inertia: x"))
    with pytest.raises(CaseError) as caught:
        read_case(text, path="my.yaml")
    first, second = str(caught.value).split("\n")
    line, column = place(text, "-2")
    assert first == f"my.yaml:{line}:{column}: bodies.a.mass: found -2, allowed is a number > 0"
    assert second.startswith("my.yaml:5:25: bodies.b.inertia: found the text 'x'")


def test_a_mistake_in_one_place_does_not_blame_others() -> None:
    # The body cannot be made, yet it is declared; what refers to it is not wrong.
    (only,) = mistakes(changed(SMALL, ("mass: 2,", "mass: -2,")))
    assert only.path_key == "bodies.a.mass"
    (only,) = mistakes("format: 1\ntime: {end: 1}\nbodies: 3\nloads: [{body: a, moment: 1}]\n")
    assert only.path_key == "bodies"


def test_names_that_are_no_text_or_no_names_are_refused() -> None:
    for name, part in (
        ("1a", "letter"),
        ("true", "quote"),
        ("a.b", "letter"),
        ("é", "letter"),
        ("null", "quote"),
    ):
        found = mistakes(changed(SMALL, ("  belts:", f"  {name}:"), ("volume: all", "volume: [x]")))
        assert any(part in m.message and m.line == 10 and m.column == 3 for m in found), name
    assert read_case(changed(SMALL, ("  belts:", '  "_a-1":'))).members[0].name == "_a-1"


def test_line_breaks_in_names_stay_within_their_line() -> None:
    found = mistakes(changed(SMALL, ("  belts:", '  "be\\nlts":'), ("volume: all", "volume: [bel]")))
    assert found
    assert all("\n" not in m.located("x.yaml") for m in found)


@pytest.mark.parametrize("data", [b"format: \xff\n", b"format: 1\ntitle: \xe9t\xe9\n", "format: 1".encode("utf-16")])
def test_a_file_that_is_not_utf8_is_refused_at_the_byte(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "x.yaml"
    path.write_bytes(data)
    with pytest.raises(CaseError) as caught:
        load_case(path)
    (mistake,) = caught.value.mistakes
    bad = next(i for i, byte in enumerate(data) if byte > 0x7F)
    assert mistake.line == data[:bad].count(b"\n") + 1
    assert "UTF-8" in mistake.message


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    for path in (
        f"{tmp_path}/none.yaml",
        str(tmp_path),
        f"{tmp_path}/a\0b",
        "/dev/null",
        f"{tmp_path}/{'x' * 400}",
    ):
        with pytest.raises(CaseError) as caught:
            load_case(path)
        assert str(caught.value).startswith(f"{path}:1:1: ")


def test_very_many_mistakes_are_cut_short_in_good_time() -> None:
    import time

    loads = "".join(f"  - {{body: b{i}, moment: x}}\n" for i in range(5000))
    start = time.perf_counter()
    found = mistakes(SMALL[: SMALL.index("loads:")] + "loads:\n" + loads)
    assert time.perf_counter() - start < 10.0
    assert len(found) == 1001
    assert "more mistakes" in found[-1].message


def test_a_decimal_comma_between_braces_is_told_as_one() -> None:
    found = mistakes(SMALL.replace("{mass: 2,", "{mass: 2,5,"))
    assert [each.message[:47] for each in found] == ["unknown key '5' (the decimal sign is a point), "]
