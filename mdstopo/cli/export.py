"""`mdstopo export`: a result as CSV tables, as JSON, or its motion as a scene that viewers of glTF show."""

from pathlib import Path

import click

from mdstopo.cli.options import FILE, result_argument
from mdstopo.cli.output import Output

_NOT_IN_TABLES = ("optimizer", "resume", "pareto/tasks", "sweep/tasks", "combine/tasks")


@click.command("export")
@result_argument
@click.option("--csv", "kind", flag_value="csv", help="Tables: members, iterations, front, fit, trajectories.")
@click.option("--json", "kind", flag_value="json", help="One JSON document with every dataset.")
@click.option("--gltf", "kind", flag_value="glb", help="The motion as one binary glTF file, for any viewer.")
@click.option("--point", type=click.IntRange(0), metavar="K", help="Of a front: --gltf of the design of this point.")
@click.option("--slower", type=click.FloatRange(0.0, min_open=True), metavar="F", help="Of --gltf: F times as slow.")
@click.option("--out", type=FILE, metavar="PLACE", help="Folder of the tables, or the file (default: beside it).")
@click.option("--quiet", "-q", is_flag=True, help="Say nothing but mistakes.")
def command(
    result_path: Path, kind: str | None, point: int | None, slower: float | None, out: Path | None, quiet: bool
) -> int:
    """Write what a result file holds as --csv tables or one --json document, or its motion as --gltf.

    \f
    Arguments, which --help leaves out:

    result_path: the result file.
    kind: csv, json or glb; None is a mistake.
    point: of a front, whose design moves.
    slower: by this factor the animations are; None as it was.
    out: the folder of the tables, or the file; None takes a place beside the result.
    quiet: say nothing but mistakes.
    """
    if kind is None:
        raise click.UsageError("say --csv, --json or --gltf")
    if kind != "glb" and (point is not None or slower is not None):
        raise click.UsageError("--point and --slower are for --gltf")
    if kind == "glb":
        return _gltf(result_path, point, slower or 1.0, out, Output(json=False, quiet=quiet))
    from mdstopo.store.admit import made_from
    from mdstopo.store.atomic import replace_file
    from mdstopo.store.export_tables import as_csv, as_json, tables
    from mdstopo.store.result_reader import read_result
    from mdstopo.store.store_errors import StoreError
    from mdstopo.store.stored_case import case_of

    output = Output(json=False, quiet=quiet)
    view = read_result(result_path, leave_out=_NOT_IN_TABLES if kind == "csv" else ())
    place = out or result_path.with_suffix(f".{kind}")
    if kind == "json":
        goal = made_from(view, place)
        replace_file(goal, "".join(as_json(view)).encode(errors="replace"))
        output.say(str(place))
        return 0
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreError(f"{place}: cannot be written: {error.strerror}") from error
    for name, table in tables(view, case_of(view)).items():
        file = place / f"{name.replace('/', '_')}.csv"
        goal = made_from(view, file)
        replace_file(goal, as_csv(table).encode(errors="replace"))
        output.say(str(file))
    return 0


def _gltf(result_path: Path, point: int | None, slower: float, out: Path | None, output: Output) -> int:
    from mdstopo.plots.source import Source
    from mdstopo.report.gltf_motion import motion_file
    from mdstopo.store.admit import made_from
    from mdstopo.store.atomic import replace_file

    source = Source(result_path, point)
    place = out or result_path.with_suffix(".glb")
    goal = made_from(source.view, place)
    data, left_out = motion_file(source, slower)
    replace_file(goal, data)
    if left_out:
        output.say(f"{left_out} members are left out: the thickest are drawn")
    output.say(str(place))
    return 0
