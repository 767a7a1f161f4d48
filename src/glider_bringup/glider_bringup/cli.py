# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The command line: ``./glider COMMAND``, or ``glider COMMAND`` where wheels were installed."""

import errno
import gc
import os
import pkgutil
import re
import signal
import sys
from functools import partial
from importlib import import_module

gc.set_threshold(100_000)  # what is imported stays: no use in looking through it again

try:  # imports take a second, in which Ctrl-C may come, and many files
    # ./glider blocks it until there is someone to take it; workers, which import this too, leave
    # it to the command
    if __name__ == '__main__':
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    import typer

    from glider_base.errors import (
        EXIT_FAILED,
        EXIT_USAGE,
        MAX_LINE,
        ConfigurationError,
        printable,
        shown,
    )
    from glider_base.plugins import COMMANDS, offered, used
    from glider_bringup import commands
    from glider_bringup.console import messages
    from glider_bringup.engines.interrupts import end_as_interrupt
    from glider_mission.disk import DiskError
except KeyboardInterrupt:
    sys.exit(130)  # EXIT_INTERRUPTED, which may not be there yet
except (OSError, ImportError) as error:
    sys.exit(f'glider: cannot be loaded: {error}')

#: Characters of one word of a command line.
MAX_WORD = 10_000
#: Spaces that no terminal acts upon, as names of files have them.
SPACES = '\n\t\u00a0\u2009\u202f\u3000'
#: What the person can mend at once; all other trouble with files is that of the machine.
_USAGE = {
    *(errno.ENAMETOOLONG, errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EEXIST),
    *(errno.EACCES, errno.EPERM, errno.EROFS, errno.ELOOP, errno.EINVAL),
}

#: Names of modules that come with ROS 2.
_OF_ROS = re.compile(r'(rcl|rosidl|rpyutils|ament_)|\w+(_msgs|_srvs|_interfaces)(\.|$)')

#: Commands in the order in which --help lists them; those that are not named here follow.
ORDER = (
    *('run', 'montecarlo', 'experiments', 'sweep', 'map', 'score', 'figure', 'report', 'compare'),
    *('export', 'replay', 'verify', 'recover', 'navigate', 'validate', 'energy'),
    *('plan', 'ocean', 'autopilot', 'trim', 'bounds', 'list'),
)
#: What the ./glider script does by itself, and --help has to tell of: text and example.
OF_THE_SCRIPT = {
    'test': (
        'Run all tests; --only fuzz, soak or mutants: those that try long and count.',
        'test',
    ),
    'python': (
        'Run Python with the stack in it: a program, -m MODULE, or an interpreter.',
        'python my_study.py',
    ),
    'jupyter': (
        'Run Jupyter with the stack in it, once it is installed there.',
        'jupyter lab examples/first_flight.ipynb',
    ),
    'bench': (
        'Measure how fast this machine flies, as ratios to baselines timed alongside.',
        'bench --only compute --json',
    ),
    'docs': ('Build the documentation as a site; --open shows it.', 'docs --open'),
    'figures': (
        'Make the moving picture of README and its figures anew.',
        'figures --at-sea ~/flights',
    ),
}


class Commands(typer.core.TyperGroup):
    """Modules in commands/ and what packages register: each is imported when it is asked for."""

    def list_commands(self, ctx: typer.Context) -> list[str]:
        """Names in their order, those of the script last."""
        names = set(_modules()) | set(offered(COMMANDS))
        order = [name for name in ORDER if name in names]
        return order + sorted(names - set(ORDER)) + list(OF_THE_SCRIPT)

    def get_command(self, ctx: typer.Context, cmd_name: str) -> typer.core.TyperCommand | None:
        """What a name stands for; None: nothing that can be used."""
        module, point = _modules().get(cmd_name), offered(COMMANDS).get(cmd_name)
        added = used(point, partial(_added, cmd_name)) if point else None
        if module:
            return _command(cmd_name, import_module(module).app)
        return added or super().get_command(ctx, cmd_name)


def _modules() -> dict[str, str]:
    """Modules in commands/ by the name of their command."""
    modules = pkgutil.walk_packages(commands.__path__, f'{commands.__name__}.')
    return {one.name.rpartition('.')[2]: one.name for one in modules if not one.ispkg}


def _command(name: str, found: typer.Typer) -> typer.core.TyperCommand:
    """Command of an application by its name: of this name, the only one, or all of them."""
    group = typer.main.get_group(found)
    alone = len(group.commands) == len(found.registered_commands) == 1
    only = [*group.commands.values()][0] if alone and not found.registered_callback else group
    command = group.commands.get(name, only)
    command.name = name
    return command


def _added(name: str, found: typer.Typer) -> typer.core.TyperCommand:
    """Command of another package."""
    if name in _modules() or name in OF_THE_SCRIPT:
        raise ValueError('its name is taken')
    if not isinstance(found, typer.Typer):
        raise TypeError('it is no typer.Typer')
    return _command(name, found)


def _refuse(called: typer.Context) -> None:
    raise ConfigurationError(
        f'{called.info_name}: run it through the ./glider script of the workspace'
    )


app = typer.Typer(
    name='glider',
    cls=Commands,
    help='Underwater gliders: simulate, guide, control, record.',
    epilog='Example: ./glider run current_8deg --controller pid',
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={'help_option_names': ['-h', '--help']},
)
_ANY_WORDS = {'ignore_unknown_options': True, 'allow_extra_args': True}
for _name, (_text, _example) in OF_THE_SCRIPT.items():
    app.command(
        _name, help=_text, epilog=f'Example: ./glider {_example}', context_settings=_ANY_WORDS
    )(_refuse)


def check_words(words: list[str]) -> None:
    """Refuse words of a command line that could not be shown as they are.

    Raises ConfigurationError.
    """
    for number, word in enumerate(words, 1):
        if len(word) > MAX_WORD:
            raise ConfigurationError(
                f'word {number} of the command line: {len(word)} characters '
                f'(allowed: <= {MAX_WORD}); give a file instead'
            )
        if printable(word, keep=SPACES) != word:
            raise ConfigurationError(
                f'word {number} of the command line: {shown(word)} '
                '(allowed: printable characters, in UTF-8)'
            )


def main() -> int:
    """Run the command line; mistakes of the user become one message and exit code 2.

    So does trouble of the machine, such as a full disk, with exit code 1.
    """
    signal.signal(signal.SIGTERM, end_as_interrupt)
    if sys.stdout is None:
        _tell('standard output is closed')
        return EXIT_FAILED
    try:
        code = _run()
        sys.stdout.flush()
    except ConfigurationError as error:
        _tell(str(error))
        code = EXIT_FAILED if isinstance(error, DiskError) else EXIT_USAGE
    except ModuleNotFoundError as error:
        if not _OF_ROS.match(error.name or ''):
            raise
        _tell(
            f'no module {error.name}: ROS 2 Jazzy, or this package of it, is not there; nodes and '
            'bags need ROS, glider run --engine direct flies without it'
        )
        code = EXIT_USAGE
    except OSError as error:
        _tell(f'{error.filename or "input or output"}: {error.strerror or error}'[:MAX_LINE])
        code = EXIT_USAGE if error.errno in _USAGE else EXIT_FAILED
    gc.freeze()  # no use in looking through it at the end either
    return code if _flushed() else code or EXIT_FAILED


def _run() -> int:
    """Run the command line; its exit code."""
    sys.stdout.reconfigure(errors='backslashreplace')
    try:
        check_words(sys.argv[1:])
        app(prog_name='./glider')
    except SystemExit as end:
        return end.code
    return 0


def _tell(text: str) -> None:
    for line in text.split('\n'):
        messages.print(line, style='red', soft_wrap=True)


def _flushed() -> bool:
    """Whether standard output took everything; if not, the interpreter shall not try again."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return False
    return True


if __name__ == '__main__':
    sys.exit(main())
