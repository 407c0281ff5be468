"""`mdstopo watch`: a page that follows a result file."""

import sys
from contextlib import suppress
from pathlib import Path

import click

from mdstopo.cli.interrupt import Interrupts
from mdstopo.cli.options import FILE
from mdstopo.cli.output import Output


@click.command("watch")
@click.argument("result_path", metavar="RESULT", type=FILE)
@click.option("--port", type=click.IntRange(0, 65535), default=0, metavar="N", help="Of this computer (default: free).")
@click.option("--open", "opens", is_flag=True, help="Open the page in the browser.")
@click.option("--quiet", "-q", is_flag=True, help="Say nothing but the address.")
def command(result_path: Path, port: int, opens: bool, quiet: bool) -> int:
    """Follow a run, front, sweep or fit on a page of this computer; Ctrl-C ends it.

    The page shows the best design, the iterations, the front, the table or the fit so far, and what is finished, too.
    The result file is only read and never locked, and may come to be later. Nobody but this computer can open the page.
    \f
    Arguments, which --help leaves out:

    result_path: the result file.
    port: of 127.0.0.1; 0 takes a free one.
    opens: whether a browser is opened.
    quiet: say nothing but the address.
    """
    from mdstopo.report.watching import server

    output = Output(quiet=False)
    Interrupts(quiet)
    with suppress(KeyboardInterrupt), server(result_path, port) as serving:
        address = f"http://{serving.server_address[0]!s}:{serving.server_port}/"
        output.say(address)
        sys.stdout.flush()
        if not quiet:
            output.notice(f"following {result_path}; Ctrl-C ends it")
        if opens:
            import webbrowser

            webbrowser.open(address)
        serving.serve_forever(poll_interval=0.2)
    return 0
