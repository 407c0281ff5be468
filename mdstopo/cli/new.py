"""`mdstopo new`: a case to start from, one of a few templates."""

import json
from pathlib import Path

import click

from mdstopo.cli.options import FILE
from mdstopo.cli.output import Output

#: where the templates are: cases whose title is `{title}`, their first line says what they are
FOLDER = Path(__file__).parent / "templates"
#: the template that is taken where none is named
USUAL = "crate"
HEAD = """\
# yaml-language-server: $schema=case.schema.json
# (`mdstopo schema --out case.schema.json` makes that file; editors then complete and check as you type)
"""


def templates() -> dict[str, str]:
    """What each template is, by name; the usual one first."""
    paths = sorted(FOLDER.glob("*.yaml"), key=lambda path: (path.stem != USUAL, path.stem))
    return {path.stem: path.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ") for path in paths}


def _names(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    return [name for name in templates() if name.startswith(incomplete)]


@click.command("new")
@click.argument("name", metavar="NAME", required=False)
@click.option("--template", metavar="T", default=USUAL, show_default=True, shell_complete=_names, help="Which one.")
@click.option("--list", "listing", is_flag=True, help="Say which templates there are.")
@click.option("--out", type=FILE, metavar="FILE", help="Where to (default: NAME.yaml).")
@click.option("--quiet", "-q", is_flag=True, help="Say nothing but mistakes.")
def command(name: str | None, template: str, listing: bool, out: Path | None, quiet: bool) -> int:
    """Write a commented case to start from: a crate on a deck, or another template."""
    output = Output(json=False, quiet=quiet)
    known = templates()
    if listing:
        output.table(list(known.items()), indent="")
        return 0
    if template not in known:
        raise click.BadParameter(f"no template {template!r}; there are {', '.join(known)}", param_hint="--template")
    if name is None:
        raise click.UsageError("Missing argument 'NAME'; `mdstopo new --list` shows the templates")
    place = out or Path(name if name.endswith((".yaml", ".yml")) else f"{name}.yaml")
    title = Path(name).stem.replace("_", " ").replace("-", " ") or "case"
    text = HEAD + (FOLDER / f"{template}.yaml").read_text(encoding="utf-8").replace("{title}", json.dumps(title), 1)
    from mdstopo.store.store_errors import StoreError

    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with place.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise StoreError(f"{place} exists already; it is left as it is") from error
    except OSError as error:
        raise StoreError(f"{place}: cannot be written: {error.strerror}") from error
    if name in known and name != template:
        output.notice(f"this is the template {template}; the one called {name} is written by --template {name}")
    output.say(f"{place}\n  mdstopo check {place}\n  mdstopo run {place}\n  mdstopo plot results/{place.stem}.h5")
    return 0
