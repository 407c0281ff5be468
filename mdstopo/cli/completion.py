"""`mdstopo completion`: what makes a shell complete the command line."""

import click
from click.shell_completion import get_completion_class

from mdstopo.cli import COMPLETE
from mdstopo.cli.output import write

SHELLS = ("bash", "zsh", "fish")


@click.command("completion")
@click.argument("shell", type=click.Choice(SHELLS))
def command(shell: str) -> int:
    """Print what makes a shell complete commands, options, their values, case files and results.

    Try it with `eval "$(mdstopo completion bash)"` (the same for zsh; in fish `mdstopo completion fish | source`). To
    keep it, put that line into ~/.bashrc, ~/.zshrc or ~/.config/fish/config.fish.
    """
    import sys

    from mdstopo.cli.group import cli

    completion = get_completion_class(shell)
    assert completion is not None
    write(sys.stdout, completion(cli, {}, "mdstopo", COMPLETE).source())
    return 0
