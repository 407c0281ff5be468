# ruff: noqa: N999 (a command is a file of its name)
"""`mdstopo import`: points of drawings, bodies and joints of robots."""

from pathlib import Path
from typing import Any

import click

from mdstopo.cli.files import FileOf
from mdstopo.cli.options import FILE
from mdstopo.cli.output import Output

_POINTS, _ROBOTS = (".csv", ".txt", ".dxf", ".svg"), (".urdf", ".xml")


@click.command("import")
@click.argument("source", metavar="FILE", type=FileOf(_POINTS + _ROBOTS))
@click.option("--body", default="ground", show_default=True, metavar="NAME", help="Of points: the body they ride on.")
@click.option("--unit", metavar="U", help="Of points: the file's unit of length, such as mm (default: what it says).")
@click.option("--fix", is_flag=True, help="Of a robot: hold its first body to ground.")
@click.option("--out", type=FILE, metavar="CASE", help="Where to write (default: standard output).")
@click.option("--quiet", "-q", is_flag=True, help="Say nothing but mistakes.")
def command(source: Path, body: str, unit: str | None, fix: bool, out: Path | None, quiet: bool) -> int:
    """Read points from CSV, DXF or SVG as the `points` of a case, or bodies and joints from URDF or MJCF as a case.

    Each layer of a drawing becomes a point grid. Bodies of a robot stand where all its joints are at zero.
    \f
    Arguments, which --help leaves out:

    source: the file.
    body: whose points they are.
    unit: of lengths in the file; None takes what the file says, else metres.
    fix: whether the first body of a robot is held.
    out: where the text goes; None prints it.
    quiet: say nothing but mistakes.
    """
    from mdstopo.case.text.yaml_text import text_of
    from mdstopo.cli.import_points import ImportedError
    from mdstopo.store.store_errors import StoreError

    output = Output(quiet=quiet)
    try:
        data = source.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise ImportedError(f"{source}: cannot be read: {error.strerror}") from error
    if source.suffix.lower() in _ROBOTS:
        from mdstopo.cli.import_robots import robot_in

        content, told = robot_in(source, data, fix)
    else:
        if fix:
            message = f"{source} has points, which have no body to hold; --fix is for robots ({', '.join(_ROBOTS)})"
            raise click.BadParameter(message, param_hint="--fix")
        content, told = _points(source, data, body, unit)
    text = text_of(content)
    if source.suffix.lower() in _ROBOTS:
        told += _refused(text)
    for sentence in told:
        output.notice(sentence)
    if out is None:
        click.echo(text, nl=False)
        return 0
    try:
        with out.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise StoreError(f"{out} exists already; it is left as it is") from error
    except OSError as error:
        raise StoreError(f"{out}: cannot be written: {error.strerror}") from error
    output.say(str(out))
    return 0


def _refused(text: str) -> list[str]:
    """Why the case that a robot becomes cannot be read, as sentences: its file may state what no body can have."""
    from mdstopo.case.reader import read_case
    from mdstopo.case.text.errors import CaseError

    try:
        read_case(text)
    except CaseError as error:
        return [f"warning: to be mended in the case: {each.path_key}: {each.message}" for each in error.mistakes]
    return []


def _points(source: Path, data: str, body: str, unit: str | None) -> tuple[dict[str, Any], list[str]]:
    """The `points` of a case, in metres, and what is said of their unit."""
    from mdstopo.case.text.quantities import QuantityError, in_si
    from mdstopo.cli.import_points import points_in
    from mdstopo.cli.import_robots import as_name

    layers, stated = points_in(source, data)
    told = []
    if unit is not None:
        try:
            scale = in_si(f"1 {unit}", "m")
        except QuantityError as error:
            raise click.BadParameter(f"{unit!r}: {error}", param_hint="--unit") from error
    else:
        scale = 1.0 if stated is None else stated
        said = "the file does not say its unit: metres" if stated is None else f"the file's unit is {scale:g} m"
        told.append(f"{source}: {said}; --unit takes another")
    grids = {
        as_name(layer): {"body": body, "grid": {"list": [[_scaled(x, scale) for x in point] for point in points]}}
        for layer, points in layers.items()
    }
    return {"points": grids}, told


def _scaled(value: float, scale: float) -> float:
    """A coordinate in metres, without the dust of rounding of a product."""
    return value if scale == 1.0 else float(f"{value * scale:.15g}")
