# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""``./glider test``: all tests, those of `LANES`, or pytest with the words given."""

import os
import signal
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / 'src'
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
#: All of them, file by file, so many at a time: processors have something to do while one waits.
ALL = (
    *('-m', 'pytest', '--numprocesses=4', '--dist=loadfile', '--no-loadscope-reorder'),
    *(str(path) for path in (ROOT / 'test', *sorted(SOURCES.glob('*/test')))),
)


def main(arguments):
    """Become the run of all tests, of one of `LANES`, or of pytest with the arguments given."""
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    # under nohup or in the background SIGINT may be ignored; the tests send it and mean it
    signal.signal(signal.SIGINT, signal.default_int_handler)
    words = ('-m', 'pytest', *arguments) if arguments else ALL
    if arguments[:1] == ['--only']:
        lane = arguments[1] if len(arguments) > 1 else ''
        if lane not in LANES:
            allowed = ', '.join(LANES)
            sys.stderr.write(f'glider: test --only {lane}: no such tests (allowed: {allowed})\n')
            return 2
        paths = [str(ROOT / 'test'), os.environ.get('PYTHONPATH', '')]
        os.environ['PYTHONPATH'] = os.pathsep.join(filter(None, paths))
        words = (*LANES[lane], *arguments[2:])
    # logs of flights are kept and forgotten: to give their memory back, page by page, takes time
    os.environ |= {f'MALLOC_{what}_THRESHOLD_': str(1 << 30) for what in ('MMAP', 'TRIM')}
    os.execv(sys.executable, [sys.executable, *words])


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
