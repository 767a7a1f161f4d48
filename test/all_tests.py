# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider test``: all tests, those of `LANES`, or pytest with the words given."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / 'src'
#: Logs of the runs; those beside a sourced ROS 2 have a folder of their own.
LOGS = ROOT / f'log{Path(sys.prefix).name.removeprefix(".venv")}'
#: What is tested by itself, by name. fast: what a vehicle flies with, the structure, the bits of
#: flights; no run over nodes. The others are counted: a module of test/, a program.
FAST = [
    *(f'{SOURCES}/glider_{name}/test' for name in ('base', 'model', 'navigation')),
    *(f'{SOURCES}/glider_{name}/test' for name in ('guidance', 'control', 'guard')),
    *(f'{ROOT}/test/test_{name}.py' for name in ('architecture', 'flight_digests')),
]
LANES = {
    'fast': ('-m', 'pytest', '--ignore', f'{FAST[0]}/test_lockstep.py', *FAST),
    'fuzz': ('-m', 'fuzzing'),
    'mutants': ('-m', 'mutants'),
    'soak': ('-m', 'soak'),
}
#: So many runs of tests go on at a time: processors have something to do while a test waits.
AT_ONCE = 4
#: Files of tests by the folder that they are in: each entry is a run of its own, of some minutes,
#: and the rest of the folder is one more. The small ones come last: no long one is waited for.
APART = (
    (ROOT, ('tutorial', 'slow_machine', 'theory')),
    (ROOT, ('my_law', 'outside_recorder')),
    (f'{SOURCES}/glider_studies', ('random_faults', 'forecasts', 'fault_matrix', 'montecarlo')),
    (
        f'{SOURCES}/glider_bringup',
        ('actuator_errors', 'afloat', 'bottom', 'failing_parts', 'fin', 'guard_flights')
        + ('lyapunov', 'missed_fixes', 'real_vehicles', 'reckoned_run', 'righting'),
    ),
    (f'{SOURCES}/glider_bringup', ('kills', 'launch', 'replay', 'runner', 'vanished')),
    (ROOT, ('faults', 'live_view')),
    (ROOT, ('autopilot', 'driver_restart', 'your_vehicle')),
    (ROOT, ('message_faults', 'rudder', 'two_gliders')),
    (
        f'{SOURCES}/glider_bringup',
        ('full_disk', 'held_flight', 'hostile_input', 'lost_input', 'no_progress', 'orders')
        + ('own_sensors',),
    ),
    (ROOT, ('benchmarks', 'flight_digests', 'mutants', 'site', 'soak')),
)


def main(arguments):
    """Run all tests, one of `LANES`, or pytest with the arguments given; return the exit code.

    Several runs go on at the same time.
    """
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    # under nohup or in the background SIGINT may be ignored; the tests send it and mean it
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if arguments[:1] == ['--only']:
        lane = arguments[1] if len(arguments) > 1 else ''
        if lane not in LANES:
            allowed = ', '.join(LANES)
            sys.stderr.write(f'glider: test --only {lane}: no such tests (allowed: {allowed})\n')
            return 2
        paths = [str(ROOT / 'test'), os.environ.get('PYTHONPATH', '')]
        os.environ['PYTHONPATH'] = os.pathsep.join(filter(None, paths))
        os.execv(sys.executable, [sys.executable, *LANES[lane], *arguments[2:]])
    if arguments:
        os.execv(sys.executable, [sys.executable, '-m', 'pytest', *arguments])
    os.environ.pop('PYTHONDONTWRITEBYTECODE', None)  # hundreds of processes would read it again
    longest = ['glider_bringup', 'glider_studies', 'glider_base']
    others = sorted(path.parent.name for path in SOURCES.glob('*/package.xml'))
    names = longest + [name for name in others if name not in longest]
    rest = {ROOT: ['test'], **{f'{SOURCES}/{name}': ['test'] for name in names}}
    apart = []
    for folder, own in APART:
        files = [f'test/test_{name}.py' for name in own]
        rest[folder] += [f'--ignore={file}' for file in files]
        apart.append((folder, files))
    runs = [*list(rest.items())[:2], *apart, *list(rest.items())[2:]]
    codes = side_by_side([sys.executable, '-m', 'pytest'], runs)
    failed = dict.fromkeys(
        os.path.relpath(f'{folder}/test', ROOT)
        for (folder, _), code in zip(runs, codes, strict=True)
        if code
    )
    print(f'glider: tests failed: {", ".join(failed)}' if failed else 'glider: all tests passed')
    return int(bool(failed))


def side_by_side(command, runs):
    """Run a command in folders with more words each, several at a time; return their exit codes.

    What they print goes to logs, and is printed run after run, as it comes.
    """
    logs = [LOGS / f'glider_test_{n}.log' for n in range(len(runs))]
    children = []
    try:
        for number, log in enumerate(logs):
            printed, ended = 0, False
            while not ended:
                running = sum(child.poll() is None for child in children)
                for folder, words in runs[len(children) :][: AT_ONCE - running]:
                    with open(logs[len(children)], 'wb') as output:
                        children.append(start([*command, *words], folder, output))
                ended = number < len(children) and children[number].poll() is not None
                with open(log, errors='replace') as file:
                    text = file.read()
                print(text[printed:], end='', flush=True)
                printed = len(text)
                time.sleep(0.0 if ended else 0.5)
    except BaseException:
        for child in children:
            stop(child)
        raise
    return [child.returncode for child in children]


def start(command, folder, output):
    """Start a run, in a session of its own: Ctrl-C comes here, and from here to all of it."""
    return subprocess.Popen(
        command,
        cwd=folder,
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )


def stop(child):
    """End a run and all that it started, with time for its clean-up."""
    for number in (signal.SIGINT, signal.SIGKILL):
        try:
            os.killpg(child.pid, number)
            child.wait(10.0)
        except (ProcessLookupError, subprocess.TimeoutExpired):
            pass
    child.wait()


if __name__ == '__main__':
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.stderr.write('glider: interrupted\n')
        sys.exit(130)
