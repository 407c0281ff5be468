"""The commands as Markdown, from the definitions that the command line itself uses."""

import inspect

import click

from mdstopo.cli.commands import COMMANDS, EXIT_STATUSES
from mdstopo.cli.group import cli


def commands() -> str:
    """Every command with its use, help and options, in the order of `mdstopo --help`."""
    above = click.Context(cli, info_name="mdstopo")
    parts = []
    for name in COMMANDS:
        command = cli.get_command(above, name)
        assert command is not None
        parts += _told(command, name, above, 3)
    return "\n\n".join(parts)


def exit_statuses() -> str:
    """What the exit status of a command means, as a table."""
    rows = [f"| {number} | {meaning} |" for number, meaning in EXIT_STATUSES.items()]
    return "\n".join(["| exit status | meaning |", "| --- | --- |", *rows])


def _told(command: click.Command, name: str, above: click.Context, depth: int) -> list[str]:
    context = click.Context(command, info_name=name, parent=above, help_option_names=["-h", "--help"])
    words = " ".join([context.command_path, *command.collect_usage_pieces(context)])
    parts = [
        f"{'#' * depth} `{context.command_path}` {{ #{context.command_path.replace(' ', '-')} }}",
        f"```text\n{words}\n```",
        _escaped(inspect.cleandoc(command.help or "")),
    ]
    options = [each for each in command.get_params(context) if isinstance(each, click.Option)]
    rows = [_row(each, context) for each in options if not each.hidden]
    parts.append("\n".join(["| option | meaning |", "| --- | --- |", *rows]))
    if isinstance(command, click.Group):
        for sub in command.list_commands(context):
            below = command.get_command(context, sub)
            assert below is not None
            parts += _told(below, sub, context, depth + 1)
    return parts


def _row(option: click.Option, context: click.Context) -> str:
    """An option and what it means; the words that it takes are told with the meaning."""
    record = option.get_help_record(context)
    words, meaning = record if record is not None else (", ".join(option.opts), "")
    told = [_escaped(meaning)]
    if isinstance(option.type, click.Choice):
        words = ", ".join(option.opts)
        told.append(f"One of {', '.join(f'`{choice}`' for choice in option.type.choices)}.")
    return f"| `{words}` | {'<br>'.join(part for part in told if part)} |"


def _escaped(text: str) -> str:
    """Plain text as Markdown for a table or a paragraph; what stands in backquotes stays code."""
    parts = text.split("`")
    for i in range(0, len(parts), 2):
        for character in "\\|*_<>[]":
            parts[i] = parts[i].replace(character, f"\\{character}")
    return "`".join(parts)
