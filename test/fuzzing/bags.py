# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Bags with one flipped bit, or cut, through all that reads bags.

Half of them are as we write them, half without a checksum of the data section, as those of ros2
bag; half lie in a run folder, half alone. What a command makes of one counts as wrong if it
is not what it makes of the unharmed bag, and says neither so nor what is missing.
"""

import random
import shutil
import tempfile
from collections.abc import Callable
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

from mcap.opcode import Opcode

from fuzzing.counts import Counter
from fuzzing.watch import outcome_of
from glider_base.settings import ConfigurationError
from glider_bringup.engines.recorded import fly_recorded
from glider_bringup.scoring.again import score_again
from glider_bringup.scoring.card import scorecard, write_score
from glider_bringup.scoring.score import Scorer, scores_of
from glider_bringup.scoring.traces import make_tracer
from glider_bringup.showing.flown_run import keep_traces, read_run
from glider_bringup.showing.report import report_page
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.recover import recover
from glider_mission.recording.ros.node_settings import read_settings
from glider_mission.recording.ros.recorded_run import Recording
from glider_mission.recording.ros.republish import plan_replay, recorded_messages
from glider_mission.recording.ros.verify.every_block import report, verify
from glider_mission.run_folder import make_run_folder
from glider_mission.scenario import Scenario, load_scenario

#: Two minutes in which everything happens, in ten chunks.
FLIGHT = {
    'dives': 0,
    'duration_s': 120.0,
    'settle_s': 0.0,
    'profile.prepare_s': 20.0,
    'profile.depth_m': 14.0,
    'profile.top_depth_m': 5.0,
    'initial.depth_m': 8.0,
    'sensors.attitude_std_deg': 0.1,
}
#: Of so many cases one is cut, the others have a flipped bit.
CUTS = 5
#: The end of the data section: opcode, length, and the checksum that there was none of.
_DATA_END = bytes([Opcode.DATA_END]) + (4).to_bytes(8, 'little')

#: What a command made of a bag, and whether it said that something is missing.
Answer = tuple[Any, bool]


def fuzz(seed: int, count: int, counter: Counter) -> None:
    """Try so many bags; see `glider_bringup.commands.fuzz`."""
    draw = random.Random(seed)
    with tempfile.TemporaryDirectory() as scratch:
        folders = _fly(Path(scratch))
        good = [
            ({name: read(folder) for name, read in COMMANDS.items()}, _bag_of(folder).read_bytes())
            for folder in folders
        ]
        for case in range(count):
            which = draw.randrange(len(folders))
            expected, data = good[which]
            folder, harmed, how = folders[which], bytearray(data), ''
            if case % CUTS == CUTS - 1:
                length = draw.randrange(len(data))
                del harmed[length:]
                how = f'cut to {length} bytes'
            else:
                bit = draw.randrange(8 * len(data))
                harmed[bit // 8] ^= 1 << bit % 8
                how = f'bit {bit % 8} of byte {bit // 8} flipped'
            _bag_of(folder).write_bytes(harmed)
            counter.add(f'{folder.name}, {how}', *_outcome(folder, expected))


def _outcome(folder: Path, expected: dict[str, Answer]) -> tuple[str, str]:
    """The worst that any command did with a bag, and why; empty if all answered well."""
    for name in COMMANDS:
        outcome, why = outcome_of(partial(_compare, name, folder, expected[name]))
        if outcome:
            return outcome, f'{name}: {why}'
    return '', ''


def _compare(name: str, folder: Path, expected: Answer) -> tuple[str, str]:
    """Whether a command refuses a bag, answers as ever, or says what is missing."""
    try:
        answer, is_told = COMMANDS[name](folder)
    except ConfigurationError:
        return '', ''
    if answer != expected[0] and not is_told:
        return 'wrong', 'another answer than from the unharmed bag'
    return '', ''


def fly_whole(scenario: Scenario, folder: Path) -> Path:
    """Fly into a folder with all that a run has."""
    run = make_run_folder(scenario, folder)
    tracer = make_tracer(scenario)
    scorer = Scorer(scenario)
    flight = fly_recorded(scenario, run, [scorer, tracer])
    card = scorecard(scenario, 'direct', flight, scores_of(scenario, scorer))
    write_score(run, card)
    keep_traces(scenario, run, card, tracer)
    return run


def _fly(scratch: Path) -> list[Path]:
    """Folders of one flight: with a checksum and without, with all that a run has and alone."""
    run = fly_whole(load_scenario('rough_water', FLIGHT), scratch / 'run')
    folders = [run, *(scratch / name for name in ('alone', 'run_unchecked', 'alone_unchecked'))]
    data = _bag_of(run).read_bytes()
    at = data.rindex(_DATA_END) + len(_DATA_END)
    before = data[:at] + bytes(4) + data[at + 4 :]
    for folder, kept in zip(folders[1:], (data, before, before), strict=True):
        folder.mkdir()
        others = [] if folder.name.startswith('alone') else run.iterdir()
        for file in others:
            (folder / file.name).write_bytes(file.read_bytes())
        (folder / _bag_of(run).name).write_bytes(kept)
    return folders


def _bag_of(folder: Path) -> Path:
    (file,) = folder.glob('*.mcap')
    return file


# ---------------------------------------------------------------------- what reads bags


def _score(folder: Path) -> Answer:
    card = score_again(folder)
    return card, bool(card['reason'])


def _report(folder: Path) -> Answer:
    flown = read_run(folder)
    return sha256(report_page(flown).encode()).digest(), bool(flown.card['reason'])


def _verify(folder: Path) -> Answer:
    with tempfile.TemporaryDirectory() as scratch:
        bag = Bag(folder)
        told = read_settings(bag, folder, None, Path(scratch))
        recording = Recording(bag, None, lambda share: None, told.steers_by)
        verdicts = list(verify(recording, told, [], lambda name, share: None))
    found = report(bag, recording, told, verdicts)
    return found, bool(found['notes']) or not found['identical']


def _replay(folder: Path) -> Answer:
    bag = Bag(folder)
    plan = plan_replay(bag, [], 0.0, None, None)
    return list(recorded_messages(plan)), bool(bag.cut)


def _recover(folder: Path) -> Answer:
    """What is in a copy that was made whole; its score is what there is to say of it."""
    with tempfile.TemporaryDirectory() as scratch:
        copy = Path(shutil.copytree(folder, Path(scratch) / folder.name))
        found = recover(copy)
        card, is_told = _score(copy)
        return (found['topics'], card), is_told or bool(found['rebuilt'])


COMMANDS: dict[str, Callable[[Path], Answer]] = {
    'score': _score,
    'report': _report,
    'verify': _verify,
    'replay': _replay,
    'recover': _recover,
}
