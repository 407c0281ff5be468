"""`mdstopo report`: one HTML page for a result."""

from pathlib import Path

import click

from mdstopo.cli.options import FILE, result_argument
from mdstopo.cli.output import Output


@click.command("report")
@result_argument
@click.option("--out", type=FILE, metavar="FILE", help="Where to (default: beside the result, ending in .html).")
@click.option("--quiet", "-q", is_flag=True, help="Say nothing but mistakes.")
def command(result_path: Path, out: Path | None, quiet: bool) -> int:
    """Write one self-contained HTML page: the motion, responses, convergence, the front, the case."""
    from mdstopo.plots.source import Source
    from mdstopo.report.report_content import content
    from mdstopo.report.report_page import page
    from mdstopo.store.admit import made_from
    from mdstopo.store.atomic import replace_file

    place = out or result_path.with_suffix(".html")
    source = Source(result_path)
    goal = made_from(source.view, place)
    replace_file(goal, page(content(source)).encode(errors="replace"))
    Output(json=False, quiet=quiet).say(str(place))
    return 0
