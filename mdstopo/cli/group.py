"""The group of commands, each loaded when it is called, and the way from errors to exit statuses."""

import contextlib
import sys
from importlib import import_module

import click
from click.shell_completion import CompletionItem

from mdstopo._version import __version__
from mdstopo.cli import COMPLETE, OutputError
from mdstopo.cli.commands import COMMANDS, help_text
from mdstopo.cli.output import write


class LazyGroup(click.Group):
    """Knows its commands by name; imports `mdstopo.cli.<name>` only when that one is asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names, in the order of the table."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one command; None for an unknown name."""
        if cmd_name not in COMMANDS:
            return None
        command = import_module(f"mdstopo.cli.{cmd_name}").command
        assert isinstance(command, click.Command)
        return command

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """The commands from the table, without importing them."""
        if incomplete.startswith("-"):
            return super().shell_complete(ctx, incomplete)
        return [CompletionItem(name, help=COMMANDS[name]) for name in COMMANDS if name.startswith(incomplete)]

    def get_help(self, ctx: click.Context) -> str:
        """The same text as the short way without click."""
        return help_text()

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """As click does, with the nearest right name for a misspelt one."""
        name = args[0]
        if name not in COMMANDS and not name.startswith("-"):
            from difflib import get_close_matches

            near = get_close_matches(name, COMMANDS, n=1)
            hint = f"did you mean `{near[0]}`?" if near else f"there are {', '.join(COMMANDS)}"
            raise click.UsageError(f"no command `{name}`; {hint}", ctx)
        return super().resolve_command(ctx, args)


def _show_version(context: click.Context, _parameter: click.Parameter, asked: bool) -> None:
    if asked:
        click.echo(f"mdstopo {__version__}")
        context.exit()


cli = LazyGroup(name="mdstopo", context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100})
cli.params.append(
    click.Option(
        ["--version"],
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=_show_version,
    )
)


def run_group(arguments: list[str]) -> int:
    """Run one command; its exit status. Mistakes of the user become sentences on standard error."""
    try:
        status = cli.main(arguments, prog_name="mdstopo", complete_var=COMPLETE, standalone_mode=False)
    except click.exceptions.Exit as end:
        return end.exit_code
    except click.Abort:
        raise KeyboardInterrupt from None
    except click.ClickException as error:
        with contextlib.suppress(OSError):  # a standard error that cannot be written
            error.show()
        return error.exit_code
    except (BrokenPipeError, OutputError):
        raise
    except Exception as error:
        sentence, status = _explain(error)
        if sentence is None:
            raise
        write(sys.stderr, sentence)
        return status
    return status if isinstance(status, int) else 0


def _explain(error: Exception) -> tuple[str | None, int]:
    """The sentence and the exit status for an error that is not a bug; None for one that is."""
    status = getattr(error, "exit_status", None)
    if isinstance(status, int):
        return str(error), status
    if isinstance(error, MemoryError):
        return f"there is not enough memory: {error}" if str(error) else "there is not enough memory", 1
    from mdstopo.case.text.errors import CaseError

    return (str(error), 2) if isinstance(error, CaseError) else (None, 1)
