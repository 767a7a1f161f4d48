# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a run or a study: how its files are called, and what lies in a new one."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory

from glider_bringup.mission.disk import write_whole
from glider_bringup.mission.scenario import Scenario, load_scenario
from glider_model.base.settings import ConfigurationError
from glider_model.vehicle.file import vehicle_file

SCENARIO_FILE, VEHICLE_FILE, SCORE_FILE = 'scenario.yaml', 'vehicle.yaml', 'score.json'
PARAMETERS_FILE, LOG_FILE = 'parameters.yaml', 'log.txt'
TRACES_FILE, REPORT_FILE = 'traces.npz', 'report.html'


def make_run_folder(scenario: Scenario, out: Path | None) -> Path:
    """Folder of a new run, with its scenario and vehicle in it as they are flown.

    Raises
    ------
    ConfigurationError
        If the folder cannot be made, or already holds something.
    """
    stamp = datetime.now().strftime('%Y%m%d-%H%M%S')
    folder = out or Path('runs') / f'{stamp}-{scenario.name}'
    for attempt in range(2, 100):
        if out or not folder.exists():
            break
        folder = Path('runs') / f'{stamp}-{scenario.name}-{attempt}'
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise ConfigurationError(
                f'{folder}: not empty; a run is never written over another (allowed: a new or '
                f'empty folder)'
            )
        write_whole(folder / VEHICLE_FILE, vehicle_file(scenario.vehicle))
        beside = scenario.model_copy(update={'vehicle': VEHICLE_FILE})
        write_whole(folder / SCENARIO_FILE, beside.to_yaml())
    except OSError as error:
        raise ConfigurationError(f'{folder}: {error.strerror}') from None
    return folder


def make_result_folder(folder: Path, result: str) -> None:
    """Folder for a study whose result is the file ``result``.

    Raises
    ------
    ConfigurationError
        If it cannot be made, or already holds a result.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(f'--out {folder}: {error.strerror}') from None
    if (folder / result).exists():
        raise ConfigurationError(
            f'--out {folder}: it has a {result} already; a result is never written over '
            f'another (allowed: another folder)'
        )


@contextmanager
def scenario_of(run: Path, attachments: Mapping[str, bytes]) -> Iterator[tuple[Scenario, str]]:
    """Scenario of a run, and the text of its file.

    It is the file in the run folder or, if there is none, the one attached to its bag. What it
    names stays readable as long as the context is open.

    Raises
    ------
    ConfigurationError
        If there is neither, or it is not valid.
    """
    file = run / SCENARIO_FILE
    if file.is_file():
        yield load_scenario(str(file), recorded=True), file.read_text(encoding='utf-8')
        return
    if SCENARIO_FILE not in attachments:
        raise ConfigurationError(
            f'{run}: no {SCENARIO_FILE} beside the bag, and none stored in it: put the one that '
            f'was flown beside it'
        )
    with TemporaryDirectory() as folder:
        for name in {SCENARIO_FILE, VEHICLE_FILE} & set(attachments):
            (Path(folder) / name).write_bytes(attachments[name])
        try:
            scenario = load_scenario(str(Path(folder) / SCENARIO_FILE), recorded=True)
        except ConfigurationError as error:
            raise ConfigurationError(str(error).replace(folder, f'{run}: stored')) from None
        yield scenario, attachments[SCENARIO_FILE].decode()
