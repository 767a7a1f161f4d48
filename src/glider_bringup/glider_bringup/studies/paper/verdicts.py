# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the flights say: figures of the two controllers side by side, and verdicts."""

from typing import Any

from glider_bringup.studies.paper.cases import Experiment
from glider_bringup.studies.paper.limits import figure_of

RESULT_FILE = 'experiments.json'
PASSED, FAILED = 'passed', 'failed'

#: Figures in which the two controllers are compared, and how a table names them.
COMPARED = {
    'cross_track_m.max_steady': 'max\nsteady (m)',
    'cross_track_m.rms_steady': 'rms\nsteady (m)',
    'cross_track_m.max_all': 'max\nall (m)',
    'cross_track_m.max_run': 'max\nrun (m)',
    'heading_fluctuation_deg.rms_steady': 'heading\nrms (deg)',
    'pitch_error_deg.rms_steady': 'pitch\nrms (deg)',
}
#: On a curved path, these.
COMPARED_ON_PATHS = {
    'path_error_m.e2_rms': 'e2\nrms (m)',
    'path_error_m.e2_max': 'e2\nmax (m)',
    'path_error_m.e3_rms': 'e3\nrms (m)',
    'path_error_m.e3_max': 'e3\nmax (m)',
}


def compared(rows: list[dict]) -> dict[str, str]:
    """Figures that the rows of an experiment are compared in, with the names of columns."""
    return COMPARED_ON_PATHS if 'path_error_m' in rows[0] else COMPARED


def is_better(one: float | None, other: float | None) -> bool:
    """Whether a figure is smaller than another by 0.01 at least, as printed."""
    return one is not None and (other is None or one <= other - 0.01)


def pid_better(rows: list[dict]) -> list[dict[str, Any]]:
    """Figures in which the tuned PID beats the adaptive law."""
    better = []
    adaptive = {(row['case'], row['guidance']): row for row in rows if row['controller'] != 'pid'}
    for pid in rows:
        ours = adaptive.get((pid['case'], pid['guidance']))
        if pid['controller'] != 'pid' or not ours:
            continue
        for name in compared(rows):
            one, other = figure_of(pid, name), figure_of(ours, name)
            if is_better(one, other):
                better.append(
                    {
                        'case': pid['case'],
                        'guidance': pid['guidance'],
                        'figure': name,
                        'pid': one,
                        'adaptive': other,
                    }
                )
    return better


def report(experiments: list[Experiment], rows: list[list[dict]]) -> dict[str, Any]:
    """Result of the command: what the paper says, what was flown, verdicts."""
    told = []
    for one, flown in zip(experiments, rows, strict=True):
        checks = one.judge(flown)
        passed = bool(checks) and all(check.passed for check in checks)
        told.append(
            {
                'name': one.name,
                'group': one.group,
                'section': one.section,
                'title': one.title,
                'paper': one.paper,
                'rows': flown,
                'pid_better': pid_better(flown),
                'checks': [check._asdict() for check in checks],
                'verdict': PASSED if passed else FAILED,
            }
        )
    return {'experiments': told}
