"""`mdstopo bench`: the program measured with itself."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from mdstopo.cli.options import CASE_FILE, FILE, output_options, set_option
from mdstopo.cli.output import Output

if TYPE_CHECKING:
    from collections.abc import Iterator

    from mdstopo.bench.tables import Table


@click.command("bench")
@click.argument("what", metavar="WHAT", type=click.Choice(["scaling", "work-precision", "profile", "skip"]))
@click.argument("case_path", metavar="[CASE]", type=CASE_FILE, required=False)
@set_option
@click.option("--members", type=click.IntRange(0), metavar="N", help="scaling: at most so many members.")
@click.option("--bodies", type=click.IntRange(0), metavar="N", help="scaling: at most so many bodies.")
@click.option("--picture", type=FILE, metavar="FILE", help="work-precision: draw it, as PNG, SVG or PDF.")
@click.option("--peers", is_flag=True, help="work-precision: beside other programs, in a checkout of the project.")
@output_options
def command(
    what: str,
    case_path: Path | None,
    overrides: dict[str, str],
    members: int | None,
    bodies: int | None,
    picture: Path | None,
    peers: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Measure the program on this machine.

    scaling: time and memory against the number of members, up to a million, and of bodies. work-precision: run time
    against error, over integrators, tolerances and sensitivity methods, of CASE or the paper's scene; with --peers
    beside JAX, diffrax, CasADi and SciPy, those of them that are installed. profile: where an evaluation of CASE spends
    its force sums and its time. skip: what is left out where nothing asks
    for it, and what that is worth.
    \f
    Arguments, which --help leaves out:

    what: scaling, work-precision, profile or skip.
    case_path: the case of work-precision or profile; None takes the paper's scene.
    overrides: values of the case's keys.
    members, bodies: the largest numbers of scaling; None takes all.
    picture: the file for the picture of work-precision; None draws none.
    peers: whether other programs are measured too.
    as_json, quiet: print one JSON object; say nothing but mistakes.
    """
    if case_path is not None and what not in ("work-precision", "profile"):
        raise click.UsageError(f"bench {what} takes no case")
    if peers and what != "work-precision":
        raise click.UsageError(f"bench {what} takes no --peers")
    output = Output(json=as_json, quiet=quiet)
    tables = []
    found = (
        _beside_peers(case_path, overrides, picture, output)
        if peers
        else _tables(what, case_path, overrides, members, bodies, picture, output)
    )
    for table in found:
        tables.append(table)
        output.say(table.markdown())
    from mdstopo.bench.machine import description

    machine = description()
    output.say(f"Measured on: {machine}.")
    output.document({"command": "bench", "what": what, "machine": machine, "tables": [_plain(t) for t in tables]})
    return 0


def _tables(
    what: str,
    case_path: Path | None,
    overrides: dict[str, str],
    members: int | None,
    bodies: int | None,
    picture: Path | None,
    output: Output,
) -> "Iterator[Table]":
    """The tables of a measurement of the program alone, each as it is done.

    what: scaling, work-precision, profile or skip.
    case_path: the case of work-precision or profile; None takes the paper's scene.
    overrides: values of the case's keys.
    members, bodies: the largest numbers of scaling; None takes all.
    picture: the file for the picture of work-precision; None draws none.
    output: is told how far it is.
    """
    if what == "scaling":
        from mdstopo.bench.scaling import BODIES, MEMBERS, scaling

        most, chain = (MEMBERS[-1] if members is None else members), (BODIES[-1] if bodies is None else bodies)
        yield from scaling(most, chain, output.notice)
    elif what == "skip":
        from mdstopo.bench.skip import skip

        yield from skip()
    elif what == "profile":
        from mdstopo.bench.profile import profile
        from mdstopo.bench.work_precision import paper
        from mdstopo.cli.options import open_case

        yield from profile(paper(overrides) if case_path is None else open_case(case_path, overrides))
    else:
        from mdstopo.bench.work_precision import draw, paper, table, work_precision
        from mdstopo.cli.options import open_case

        case = paper(overrides) if case_path is None else open_case(case_path, overrides)
        points = list(work_precision(case, output.notice))
        yield table(case, points)
        if picture is not None:
            draw(case, points, picture)
            output.say(str(picture))


def _beside_peers(
    case_path: Path | None, overrides: dict[str, str], picture: Path | None, output: Output
) -> "Iterator[Table]":
    from mdstopo.bench.peers import NotACheckoutError, load
    from mdstopo.cli.options import open_case

    try:
        comparison = load()
    except NotACheckoutError as error:
        raise click.UsageError(str(error)) from None
    if case_path is None and overrides:
        raise click.UsageError("--set needs CASE where other programs are asked for")
    case = None if case_path is None else open_case(case_path, overrides)
    yield from comparison(case, output.notice, picture)
    if picture is not None:
        output.say(str(picture))


def _plain(table: "Table") -> dict[str, Any]:
    columns = list(table.columns)
    rows = [dict(zip(columns, row, strict=True)) for row in table.rows]
    return {"title": table.title, "rows": rows, "notes": list(table.notes)}
