"""What the documentation generates is complete: keys of a case, commands, formulas."""

from __future__ import annotations

import re
from typing import Any

import click
import pytest

pytest.importorskip("mkdocs", reason="mkdocs is not installed: pip install -e '.[dev]'")

from documentation import array_tables, command_pages, maths
from documentation.hooks import expanded
from mdstopo.case.schema import key_tables
from mdstopo.case.schema.json_schema import json_schema
from mdstopo.case.schema.schema_case import FORMAT
from mdstopo.cli.commands import COMMANDS, EXIT_STATUSES
from mdstopo.cli.group import cli

from .pages import DOCS, blocks, data, is_case

KEYS = [
    (f"{place.path}.{key.name}".lstrip("."), key)
    for part in key_tables.places().values()
    for place in part
    for key in place.record.keys
]
CASE_PAGE = (DOCS / "case.md").read_text(encoding="utf-8")


def test_every_key_of_a_case_has_a_description() -> None:
    assert len(KEYS) > 150
    assert [path for path, key in KEYS if not key.doc] == []


def described(schema: Any, path: str = "") -> list[str]:
    """Paths of the properties of a JSON Schema that have no description."""
    if isinstance(schema, list):
        return [each for part in schema for each in described(part, path)]
    if not isinstance(schema, dict):
        return []
    properties = schema.get("properties", {})
    lacking = [
        f"{path}.{name}" for name, each in properties.items() if "description" not in each and "const" not in each
    ]
    for key, part in schema.items():
        if key == "properties":
            lacking += [found for name, each in part.items() for found in described(each, f"{path}.{name}")]
        elif key not in ("if", "not"):
            lacking += described(part, path)
    return lacking


def test_every_array_of_a_scene_is_told_on_its_page() -> None:
    page = expanded((DOCS / "arrays.md").read_text(encoding="utf-8"))
    for name, fields in array_tables.TABLES.items():
        assert array_tables.table_of(name) in page
        assert all(what and shape for field, shape, what in fields.rows() if field not in fields.numbers)
    with pytest.raises(ValueError, match="springs, general, steps, history"):
        array_tables.table_of("nothing")


def test_every_property_of_the_schema_has_a_description_for_editors() -> None:
    # the tag of joints and laws is described by what it makes of the mapping
    assert [path for path in described(json_schema()) if not path.endswith(".type")] == []


def test_every_kind_of_joint_law_and_grid_and_every_mapping_is_explained() -> None:
    assert [
        place.path for part in key_tables.places().values() for place in part if place.path and not place.record.doc
    ] == []


def test_every_word_of_a_key_is_explained() -> None:
    words = [(path, key_tables.words_of(key.kind)) for path, key in KEYS]
    several = [(path, word) for path, word in words if word is not None and len(word.words) > 1]
    assert len(several) > 8
    assert [path for path, word in several if not all(word.meanings)] == []


def test_the_page_of_the_case_has_every_key_once() -> None:
    page = expanded(CASE_PAGE)
    anchors = re.findall(r'<a id="([\w.-]+)"></a>', page) + re.findall(r"\{ #([\w.-]+) \}$", page, re.MULTILINE)
    assert len(anchors) == len(set(anchors))
    top = {key.name for key in FORMAT.keys} - {"format", "title", "gravity"}
    assert {path for path, _ in KEYS if "." in path} | top <= set(anchors)
    links = set(re.findall(r"\]\(#([\w.-]+)\)", page))
    assert links <= set(anchors)


def test_every_section_of_a_case_has_an_example() -> None:
    shown: set[str] = set()
    for block in blocks(CASE_PAGE):
        if is_case(block) or block.part:
            shown |= set(data(block.text))
    assert {key.name for key in FORMAT.keys} <= shown


@pytest.mark.parametrize("section", ["members", "joints", "points", "objectives"])
def test_every_alternative_stands_in_an_example(section: str) -> None:
    known = {place.path.split(".")[-1] for place in key_tables.places()[section] if place.path.count(".") >= 1}
    words = {
        "members": {"spring", "gap", "cubic", "curve", "pulse", "table", "actuator", "inerter"},
        "joints": {"revolute", "prismatic", "fixed", "distance"},
        "points": {"line", "arc", "circle", "rectangle", "lattice"},
        "objectives": {"displacement", "angle", "member_force", "joint_force"},
    }[section]
    assert words <= known
    text = "".join(block.text for block in blocks(CASE_PAGE))
    assert [word for word in words if not re.search(rf"\b{word}\b", text)] == []


def test_an_unknown_mark_stops_the_build() -> None:
    with pytest.raises(ValueError, match="no mapping is below 'bodys'"):
        expanded("<!-- keys: bodys -->")


def test_the_page_of_the_commands_has_every_command_and_option() -> None:
    page = expanded((DOCS / "commands.md").read_text(encoding="utf-8"))
    for number, meaning in EXIT_STATUSES.items():
        assert f"| {number} | {meaning} |" in page
    context = click.Context(cli, info_name="mdstopo")
    for name in COMMANDS:
        command = cli.get_command(context, name)
        assert command is not None
        part = page.partition(f"`mdstopo {name}` {{ #mdstopo-{name} }}")[2].partition("\n### ")[0]
        for parameter in command.params:
            if isinstance(parameter, click.Option):
                assert re.search(rf"`[^`]*{parameter.opts[0]}\b", part), f"{name} {parameter.opts[0]}"


def test_options_tell_their_choices() -> None:
    assert "| `--method` | A method; may be repeated (default: adjoint and direct).<br>One of `adjoint`, " in (
        command_pages.commands()
    )


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        (r"\alpha_i^{\mu}", "<msubsup><mi>α</mi><mi>i</mi><mrow><mi>μ</mi></mrow></msubsup>"),
        (r"\frac{\partial G}{\partial \alpha_i}", "<mfrac><mrow><mo>∂</mo><mi>G</mi></mrow>"),
        (r"\ddot q", '<mover accent="true"><mi>q</mi><mo stretchy="false">¨</mo></mover>'),
        (r"\Phi_q^\mathrm{T}", '<mi mathvariant="normal">Φ</mi><mi>q</mi><mi mathvariant="normal">T</mi>'),
        (r"\boldsymbol{\lambda}\boldsymbol{M}\mathbf{q}", "<mi>𝝀</mi></mrow><mrow><mi>𝑴</mi></mrow>"),
        (r"\sum_{i=1}^{N} V_i", '<munderover><mo movablelimits="true">∑</mo>'),
        (r"\max_t g", '<munder><mo movablelimits="true">max</mo><mi>t</mi></munder>'),
        (r"\begin{bmatrix} M & 0 \\ 0 & J \end{bmatrix}", "<mtr><mtd><mi>M</mi></mtd><mtd><mn>0</mn></mtd></mtr>"),
        (
            r"\begin{aligned} a &= b \\ c &< d \end{aligned}",
            '<mtd style="text-align: right; padding-right: 0"><mi>a</mi></mtd>',
        ),
    ],
)
def test_formulas_become_mathml(formula: str, expected: str) -> None:
    markup = maths.mathml(formula)
    assert expected in markup
    assert markup.startswith('<math display="inline">')
    assert "\\" not in markup


@pytest.mark.parametrize("formula", [r"\nosuch x", r"\frac{a}", "a &= b", r"\operatorname*{arg\,min}"])
def test_a_formula_that_cannot_be_shown_stops_the_build(formula: str) -> None:
    with pytest.raises(maths.FormulaError):
        maths.mathml(formula)


def test_formulas_are_found_in_a_page() -> None:
    page = '<p><span class="arithmatex">\\(a &lt; b\\)</span></p><div class="arithmatex">\\[\nc\n\\]</div>'
    found = maths.with_mathml(page)
    assert '<p><math display="inline">' in found
    assert "&lt;" in found
    assert '<div class="formula"><math display="block">' in found
    assert "arithmatex" not in found
