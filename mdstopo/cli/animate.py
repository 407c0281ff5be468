"""`mdstopo animate`: the motion of a result as a moving picture."""

from pathlib import Path

import click

from mdstopo.cli.options import FILE, output_options, result_argument
from mdstopo.cli.output import Output


@click.command("animate")
@result_argument
@click.option("--out", type=FILE, metavar="FILE", help="Where to: .gif, .mp4 or .svg (default: RESULT's name.gif).")
@click.option("--load-case", metavar="NAME", help="Whose motion (default: the first).")
@click.option("--point", type=click.IntRange(0), metavar="K", help="Of a front: the design of this point.")
@click.option("--frames", type=click.IntRange(2, 2000), default=60, show_default=True, help="How many pictures.")
@click.option("--seconds", type=click.FloatRange(0.1, 600), default=4.0, show_default=True, help="How long it plays.")
@click.option("--dark", is_flag=True, help="On a dark ground.")
@output_options
def command(
    result_path: Path,
    out: Path | None,
    load_case: str | None,
    point: int | None,
    frames: int,
    seconds: float,
    dark: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Write the motion of a result as a moving picture.

    GIF needs nothing else, MP4 the program ffmpeg. SVG moves by itself in a browser, stays sharp and is small.
    \f
    Arguments, which --help leaves out:

    result_path: the result file.
    out: where to; None takes a GIF beside the result.
    load_case: whose motion; None takes the first.
    point: of a front, whose design moves.
    frames: how many pictures.
    seconds: how long it plays.
    dark: whether on a dark ground.
    as_json, quiet: print one JSON object; say nothing but mistakes.
    """
    from mdstopo.plots.animation import write_motion
    from mdstopo.plots.source import Source
    from mdstopo.plots.style import styled
    from mdstopo.store.admit import made_from

    output = Output(json=as_json, quiet=quiet)
    with styled(dark) as module:
        source = Source(result_path, point)
        name = load_case or source.load_cases[0]
        if name not in source.load_cases:
            raise click.BadParameter(f"no load case {name!r}; there are {', '.join(source.load_cases)}")
        place = out or result_path.with_suffix(".gif")
        write_motion(module, source, made_from(source.view, place), name, frames, seconds)
    output.say(str(place))
    output.document({"command": "animate", "result": str(result_path), "picture": str(place), "load_case": name})
    return 0
