"""`mdstopo schema`: the JSON Schema of the case format, or the keys of a section in words."""

import json
from pathlib import Path

import click

from mdstopo.cli.options import FILE
from mdstopo.cli.output import Output


@click.command("schema")
@click.argument("section", required=False)
@click.option("--space", is_flag=True, help="Of SECTION: the keys of a case in space.")
@click.option("--out", type=FILE, metavar="FILE", help="Write it to a file.")
def command(section: str | None, space: bool, out: Path | None) -> int:
    """Print the JSON Schema of the case format, or the keys of a SECTION.

    An editor that knows the schema completes and checks a case while it is
    typed. With SECTION, a key of the case such as objectives, its keys are
    listed in words; `case` lists the sections.
    """
    from mdstopo.case.keys.brought_records import BroughtError
    from mdstopo.case.schema.json_schema import ask_distributions, json_schema

    try:
        ask_distributions()
    except BroughtError as error:
        raise click.ClickException(str(error)) from error
    if space and section is None:
        raise click.UsageError("--space goes with a SECTION")
    text = json.dumps(json_schema(), indent=2, ensure_ascii=False) if section is None else _keys(section, space)
    if out is None:
        Output().say(text)
        return 0
    from mdstopo.store.store_errors import StoreError

    try:
        out.write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{out}: cannot be written: {error.strerror}") from error
    return 0


def _keys(section: str, space: bool) -> str:
    """The keys of a section of a case, a line or more for each."""
    from mdstopo.case.schema.key_tables import lines_of, places, sections_with
    from mdstopo.case.schema.schema_case import FORMAT
    from mdstopo.case.schema.schema_space import SPACE_FORMAT

    case = SPACE_FORMAT if space else FORMAT
    known = {name or "case": name for name, part in places(case).items() if part}
    if section not in known:
        asked = "{} --space" if space else "{}"
        there = " and ".join(f"`mdstopo schema {asked.format(name)}`" for name in sections_with(section, case))
        told = f"; it is among the keys of {there}" if there else ""
        raise click.BadParameter(f"no section {section!r}{told}; there are {', '.join(known)}", param_hint="SECTION")
    return "\n".join(lines_of(known[section], case))
