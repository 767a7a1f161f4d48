# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider docs``: the documentation as a site, and the hooks by which mkdocs builds it.

Two pages are made here and stand in no file: the options of every command, and the scores of a
run. The rest is docs/ as it is, in the Markdown that GitHub shows.
"""

import logging
import re
import sys
import webbrowser
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Annotated

import click
import typer

from glider_base.errors import EXIT_FAILED, EXIT_INTERRUPTED, EXIT_USAGE
from glider_bringup.cli import OF_THE_SCRIPT
from glider_bringup.cli import app as commands
from glider_bringup.console import messages, output
from glider_bringup.scoring.scores import SCORES

ROOT = Path(__file__).resolve().parents[2]

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command(
    epilog='Example: ./glider docs --open',
    context_settings={'help_option_names': ['-h', '--help']},
)
def docs(
    show: Annotated[
        bool,
        typer.Option('--open', help='Serve the site here and show it in a browser, until Ctrl-C.'),
    ] = False,
    out: Annotated[
        Path, typer.Option(help='Folder of the site; what is in it is replaced.')
    ] = ROOT / 'build-docs',
) -> None:
    """Build the documentation as a site with search, which needs no network."""
    from mkdocs.commands.build import build
    from mkdocs.config import load_config

    logging.getLogger('mkdocs').addHandler(warnings())
    config = load_config(str(ROOT / 'mkdocs.yml'), site_dir=str(out.resolve()))
    with messages.status('building the site'):
        build(config)
    output.print(f'site: {out.resolve() / "index.html"}')
    if show:
        serve(out.resolve())


def serve(folder: Path) -> None:
    """Show a site in a browser until Ctrl-C: search needs a server, if only this one."""
    handler = partial(QuietHandler, directory=folder)
    with ThreadingHTTPServer(('127.0.0.1', 0), handler) as server:
        address = f'http://127.0.0.1:{server.server_port}/'
        output.print(f'{address} until Ctrl-C')
        webbrowser.open(address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            sys.exit(EXIT_INTERRUPTED)


class QuietHandler(SimpleHTTPRequestHandler):
    """Serves files and says nothing of each."""

    def log_message(self, *_) -> None:
        """Say nothing."""


def warnings() -> logging.Handler:
    """What shows the warnings of mkdocs, each of which ends a strict build."""
    handler = logging.StreamHandler()
    handler.setLevel(logging.WARNING)
    return handler


def on_files(files, config):
    """Hook: add the pages that are made."""
    from mkdocs.structure.files import File

    for name, text in (('options.md', options()), ('scores.md', scores())):
        files.append(File.generated(config, name, content=text))
    return files


def on_page_markdown(markdown, page, **_):
    """Hook: the Markdown of GitHub as Python-Markdown has it.

    A list or table begins without an empty line there, lists inside lists are indented by two,
    and files outside of docs/ have no page: their path is shown instead.
    """
    lines, fenced, before = [], False, ''
    for line in markdown.split('\n'):
        fenced ^= line.startswith('```')
        if not fenced:
            item = re.match(r'( *)([*-]|\d+\.) ', line)
            begins = item or line.startswith('|')
            goes_on = re.match(r' *([*-]|\d+\.) |\|| ', before)
            if begins and before and not goes_on:
                lines.append('')
            if item and item[1] or re.match(r' {2,3}\S', line):
                line = ' ' * (len(line) - len(line.lstrip())) + line
            up = r'\.\./\.\./' if page.file.src_uri.startswith('adr/') else r'\.\./'
            line = re.sub(rf'\[([^]]*)\]\({up}([^)#]*)[^)]*\)', named, line)
        lines.append(line)
        before = line
    return '\n'.join(lines)


def named(link: re.Match) -> str:
    """Text of a link to a file that has no page, and its path."""
    text, path = link[1], link[2]
    return text if text.strip('`') == path else f'{text} (`{path}`)'


def options() -> str:
    """Page of every command with its arguments and options."""
    group = typer.main.get_command(commands)
    context = click.Context(group, info_name='./glider')
    text = ['# Options of every command', '', 'As `./glider COMMAND --help` has them.']
    for name in group.list_commands(context):
        if name in OF_THE_SCRIPT:
            about, example = OF_THE_SCRIPT[name]
            text += ['', f'## {name}', '', about, '', f'    ./glider {example}']
            continue
        command = group.get_command(context, name)
        text += ['', f'## {name}', '', re.sub(r'\n(?!\n)', ' ', command.help.replace('\b', ''))]
        text += ['', '| | default | meaning |', '| --- | --- | --- |']
        for one in command.params:
            names = ', '.join((*one.opts, *one.secondary_opts)) or one.name
            given = '' if callable(one.default) or one.default in (None, False) else one.default
            about = (getattr(one, 'help', '') or '').replace('|', r'\|').replace('\n', ' ')
            text.append(f'| `{names}` | {given} | {about} |')
        if command.epilog:
            text += ['', f'`{command.epilog.removeprefix("Example: ")}`']
    return '\n'.join(text) + '\n'


def scores() -> str:
    """Page of every score of a run, as `SCORES` has them."""
    text = ['# Scores of a run', '', 'In `score.json`, scorecard and comparison.', '']
    text += ['| in `score.json` | unit there or shown | meaning | better |']
    text += ['| --- | --- | --- | --- |']
    for one in SCORES:
        better = 'less' if one.less_is_better else ''
        text.append(f'| `{one.key}` | {one.unit} | {one.label} | {better} |')
    return '\n'.join(text) + '\n'


def main() -> None:
    """Build, or say in one sentence why not."""
    try:
        import material  # noqa: F401
        import mkdocs  # noqa: F401
    except ImportError:
        messages.print(
            'glider: docs: no mkdocs here; install it with: ./glider python -m pip install '
            '--no-deps -r requirements-docs.txt',
            soft_wrap=True,
        )
        sys.exit(EXIT_USAGE)
    from mkdocs.exceptions import Abort

    try:
        app(prog_name='./glider docs')
    except Abort as error:
        messages.print(f'glider: docs: {error}')
        sys.exit(EXIT_FAILED)


if __name__ == '__main__':
    main()
