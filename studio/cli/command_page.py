"""The guide's page of commands, made of the commands themselves: `make guide` writes it."""

import click

from studio.cli.main import COMMANDS, main

INTRODUCTION = """# Commands

Each shows progress and the time left, takes `--json`, ends on Ctrl-C with what is finished kept, and exits with code 2,
the cause and a remedy when its input is wrong. `-h` after a command says the same as this page.
"""


def command_page() -> str:
    """All commands with their options, as Markdown."""
    context = click.Context(main, info_name="studio")
    parts = [INTRODUCTION]
    for name in COMMANDS:
        command = main.get_command(context, name)
        assert command is not None
        parts += _section(command, name, context)
    return "\n".join(parts)


def _section(command: click.Command, name: str, context: click.Context) -> list[str]:
    """A command with its options, and those that stand below it."""
    inner = click.Context(command, info_name=name.rpartition(" ")[2], parent=context)
    usage = " ".join(["studio", name, *command.collect_usage_pieces(inner)])
    parts = [f"## {name}\n\n`{usage}`\n\n{_paragraphs(command.help or '')}\n"]
    listed = [entry for entry in command.params if isinstance(entry, click.Option)]
    rows = [record for entry in listed if (record := entry.get_help_record(inner))]
    if rows:
        parts.append("| option | what it does |\n|---|---|")
        parts += [f"| `{_cell(option)}` | {_cell(help_text)} |" for option, help_text in rows]
        parts.append("")
    if isinstance(command, click.Group):
        for below, one in command.commands.items():
            parts += _section(one, f"{name} {below}", inner)
    return parts


def _paragraphs(text: str) -> str:
    return "\n\n".join(" ".join(part.split()) for part in text.replace("\b", "").split("\n\n"))


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|").replace("<", "&lt;")


if __name__ == "__main__":
    click.echo(command_page(), nl=False)
