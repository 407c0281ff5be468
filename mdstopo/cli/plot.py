"""`mdstopo plot`: pictures of a result."""

from pathlib import Path
from typing import Any

import click

from mdstopo.cli.options import FILE, output_options, result_argument
from mdstopo.cli.output import Output


def _pictures(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
    """Names of pictures that begin so."""
    from mdstopo.plots.plot_table import PLOTS

    return [name for name in PLOTS if name.startswith(incomplete)]


@click.command("plot")
@result_argument
@click.argument("what", required=False, metavar="[WHAT]", shell_complete=_pictures)
@click.option("--out", type=FILE, metavar="FILE", help="Where to: .png, .svg or .pdf (default: beside the result).")
@click.option("--format", "ending", type=click.Choice(["png", "svg", "pdf"]), default="png", show_default=True)
@click.option("--time", "times", type=float, multiple=True, metavar="T", help="Layout at this time; may be repeated.")
@click.option("--overlay", is_flag=True, help="Layouts of several times in one drawing.")
@click.option("--dark", is_flag=True, help="On a dark ground.")
@click.option("--load-case", metavar="NAME", help="Of layout at a time, and of histories.")
@click.option("--point", type=click.IntRange(0), metavar="K", help="Of a front: the design of this point.")
@click.option("--members", type=click.IntRange(1), metavar="N", help="Sensitivities of the first N members.")
@output_options
def command(
    result_path: Path,
    what: str | None,
    out: Path | None,
    ending: str,
    times: tuple[float, ...],
    overlay: bool,
    dark: bool,
    load_case: str | None,
    point: int | None,
    members: int | None,
    as_json: bool,
    quiet: bool,
) -> int:
    """Draw what a result file holds.

    WHAT is one of layout, designs (start and final beside each other), convergence, design, sensitivities, histories,
    sensitivity-histories, front, and of a fit fit, correlation, profiles; without it, everything that the file has is
    drawn.
    \f
    Arguments, which --help leaves out:

    result_path: the result file.
    what: the picture; None draws all.
    out: the file for one picture; None takes one beside the result.
    ending: png, svg or pdf, where `out` does not say.
    times: at which a layout is drawn (s).
    overlay: whether these are in one drawing.
    dark: whether on a dark ground.
    load_case: of a layout at a time, and of histories.
    point: of a front, whose design is drawn.
    members: how many have their sensitivities drawn.
    as_json, quiet: print one JSON object; say nothing but mistakes.
    """
    from mdstopo.plots.plot_table import PLOTS, fitting
    from mdstopo.plots.source import Source
    from mdstopo.plots.style import save, styled

    output = Output(json=as_json, quiet=quiet)
    if what is not None and what not in PLOTS:
        raise click.BadParameter(f"no picture {what!r}; there are {', '.join(PLOTS)}", param_hint="WHAT")
    if out is not None and what is None:
        raise click.UsageError("--out is for one picture: say which")
    written = []
    if overlay and len(times) < 2:
        raise click.UsageError("--overlay is for layouts at two times or more: --time T1 --time T2")
    with styled(dark) as module:
        source = Source(result_path, point)
        if load_case is not None and load_case not in source.load_cases:
            raise click.BadParameter(
                f"no load case {load_case!r}; there are {', '.join(source.load_cases)}", param_hint="--load-case"
            )
        given = {"times": times, "load_case": load_case, "members": members, "marked": point}
        given["overlay"] = overlay or None
        for name in [what] if what else fitting(source.view):
            plot = PLOTS[name]
            options: dict[str, Any] = {key: given[key] for key in plot.options if given[key] not in (None, ())}
            place = out or result_path.with_name(f"{result_path.stem}-{name}.{ending}")
            save(plot.draw(module, source, **options), place)
            written.append(str(place))
            output.say(str(place))
    output.document({"command": "plot", "result": str(result_path), "pictures": written})
    return 0
