# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a run or a study: how its files are called, and what lies in a new one."""

import fcntl
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from glider_base.settings import ConfigurationError
from glider_mission.disk import write_whole
from glider_mission.scenario import Scenario, load_scenario
from glider_model.vehicle.file import vehicle_file

SCENARIO_FILE, VEHICLE_FILE, SCORE_FILE = 'scenario.yaml', 'vehicle.yaml', 'score.json'
PARAMETERS_FILE, LOG_FILE = 'parameters.yaml', 'log.txt'
TRACES_FILE, REPORT_FILE = 'traces.npz', 'report.html'


def make_run_folder(scenario: Scenario, out: Path | None) -> Path:
    """Folder of a new run, with its scenario and vehicle in it as they are flown.

    Raises ConfigurationError if the folder cannot be made, or already holds something.
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
        write_scenario(scenario, folder)
    except OSError as error:
        raise ConfigurationError(f'{folder}: {error.strerror}') from None
    return folder


@contextmanager
def run_folder(scenario: Scenario, out: Path | None) -> Iterator[Path]:
    """The folder that `make_run_folder` makes, which is gone if its flight is refused."""
    folder = make_run_folder(scenario, out)
    try:
        yield folder
    except ConfigurationError:
        if {file.name for file in folder.iterdir()} == {SCENARIO_FILE, VEHICLE_FILE}:
            shutil.rmtree(folder)
        raise


def write_scenario(scenario: Scenario, folder: Path) -> None:
    """Write the scenario of a run, with the vehicle that lies beside it."""
    write_whole(folder / SCENARIO_FILE, scenario.to_yaml(vehicle=VEHICLE_FILE))


def make_result_folder(folder: Path, result: str) -> None:
    """Folder for a study whose result is the file ``result``, until this program ends.

    Raises ConfigurationError if it cannot be made, already holds a result, or will hold that of
    another study.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise ConfigurationError(f'--out {folder}: {error.strerror}') from None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise ConfigurationError(
            f'--out {folder}: another study is at work here (allowed: another folder)'
        ) from None
    except OSError:  # some file systems have no locks
        pass
    if (folder / result).exists():
        raise ConfigurationError(
            f'--out {folder}: it has a {result} already; a result is never written over '
            f'another (allowed: another folder)'
        )


class FlownScenario(NamedTuple):
    """Scenario of a run."""

    scenario: Scenario
    text: str  #: of its file
    source: str  #: where it stands


def find_scenario(
    run: Path, folder: Path, attachments: Mapping[str, bytes], scratch: Path
) -> FlownScenario | None:
    """Scenario of a run: the file in ``folder`` or else the one attached to its bag; or none.

    ``run`` is what the person called it. Attached files go to ``scratch``, which has to stay as
    long as the scenario is used. Raises ConfigurationError if it is not valid, or not what the bag
    says was flown.
    """
    file = folder / SCENARIO_FILE
    if file.is_file():
        _refuse_another(folder, attachments)
        scenario = load_scenario(str(file), recorded=True)
        return FlownScenario(scenario, file.read_text(encoding='utf-8'), str(file))
    if SCENARIO_FILE not in attachments:
        return None
    for name in {SCENARIO_FILE, VEHICLE_FILE} & set(attachments):
        (scratch / name).write_bytes(attachments[name])
    try:
        scenario = load_scenario(str(scratch / SCENARIO_FILE), recorded=True)
    except ConfigurationError as error:
        text = str(error).replace(f'{scratch}/', f'{run}: attached ')
        raise ConfigurationError(text) from None
    text = attachments[SCENARIO_FILE].decode()
    return FlownScenario(scenario, text, f'{SCENARIO_FILE} attached to {run}')


def _refuse_another(folder: Path, attachments: Mapping[str, bytes]) -> None:
    """Refuse files of a run that are not those that were flown, which its bag has."""
    for name in (SCENARIO_FILE, VEHICLE_FILE):
        file = folder / name
        if name in attachments and file.is_file() and file.read_bytes() != attachments[name]:
            raise ConfigurationError(
                f'{file}: not the one that was flown, which is attached to the bag (allowed: that '
                f'one, or none)'
            )


@contextmanager
def scenario_of(run: Path, attachments: Mapping[str, bytes]) -> Iterator[FlownScenario]:
    """Scenario of a run, usable as long as the context is open; errors as `find_scenario`."""
    with TemporaryDirectory() as scratch:
        found = find_scenario(run, run, attachments, Path(scratch))
        if found is None:
            raise ConfigurationError(
                f'{run}: no {SCENARIO_FILE} beside the bag, and none attached to it: put the one '
                f'that was flown beside it'
            )
        yield found
