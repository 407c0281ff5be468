"""`mdstopo schema`: the JSON Schema of the case format."""

import json
from pathlib import Path

import click

from mdstopo.cli.options import FILE
from mdstopo.cli.output import Output


@click.command("schema")
@click.option("--out", type=FILE, metavar="FILE", help="Write it to a file.")
def command(out: Path | None) -> int:
    """Print the JSON Schema of the case format.

    An editor that knows it completes and checks a case while it is typed.
    """
    from mdstopo.case.distributions import BroughtError
    from mdstopo.case.schema_case import ask_distributions, json_schema

    try:
        ask_distributions()
    except BroughtError as error:
        raise click.ClickException(str(error)) from error
    text = json.dumps(json_schema(), indent=2, ensure_ascii=False)
    if out is None:
        Output().say(text)
        return 0
    from mdstopo.store.store_errors import StoreError

    try:
        out.write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{out}: cannot be written: {error.strerror}") from error
    return 0
