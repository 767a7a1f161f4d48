# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Nothing has changed in flight since flight_digests.json was made, to the last bit.

    ./glider python test/test_flight_digests.py > test/flight_digests.json     makes it anew

Whoever changes what is flown, and means it, does that and says in CHANGELOG what has changed. A
digest is that of the numbers of some topics, tick by tick, over ten hours by the direct engine:
of those that there were when the table was made first, and of no more of their numbers than they
had then. What has been added since (the truth apart from what is believed, navigation, the
covariance of odom) is not in it, so that the table also says that adding it changed no flight.
Short flights, in each of which something happens that is rare in ten hours, are those by which
changes of kernels are noticed (`mutants.trial`); all their numbers are in their digests, and those
of ticks from states along them in which some numbers were changed.
Sine and exponential belong to the C library: on another one the last bits differ, and so does the
digest of the probe, of what the library makes of some arguments. Linear algebra is no part of it:
its last bits are others on each kind of processor.
"""

import hashlib
import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from glider_base.kernel import kernel
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_mission.blocks import COLUMNS, ROW
from glider_mission.scenario import load_scenario
from mutants.trial import FLIGHTS, digest_of

DURATION_S = 36000.0
#: Scenario and changed fields of each mission.
MISSIONS = {
    'current_8deg': ('current_8deg', {}),
    'rough_water': ('rough_water', {}),
    'noisy_sensors': ('noisy_sensors', {}),
    'helix': ('helix', {}),
    'survey': ('survey', {}),
    'seawing': ('current_8deg', {'vehicle': 'seawing'}),
}
#: Topics and flags of which a digest is made, and the numbers of each, from the first on.
NUMBERS = {
    'adaptation': 13,
    'command': 3,
    'current_estimate': 3,
    'current_velocity': 3,
    'infeasible': 1,
    'joint_states': 3,
    'odom': 13,
    'reference': 13,
    'saturation': 1,
    'stage': 1,
    'tracking_error': 3,
    'wrench': 3,
}
#: Fields of the three ways in which each is flown.
WAYS = {
    'adaptive': {'control.law': 'adaptive', 'guidance.los.method': 'los_current'},
    'pid': {'control.law': 'pid', 'guidance.los.method': 'los_current'},
    'paper': {'control.law': 'adaptive', 'guidance.los.method': 'los_zhang2021'},
}


@kernel
def _functions(x):
    return (
        math.sin(x),
        math.cos(x),
        math.tan(x),
        math.asin(math.sin(x)),
        math.atan2(x, 3.0),
        math.exp(-x * x),
        math.log(1.0 + x * x),
        math.sqrt(x * x + 0.1),
    )


def probe() -> str:
    """Digest of what the mathematical library makes of some arguments."""
    numbers = [_functions(0.001 * i - 2.0) for i in range(4000)]
    return hashlib.sha256(np.array(numbers).tobytes()).hexdigest()[:16]


def columns(topic: str) -> np.ndarray:
    """Columns of a log row that belong to a topic, or to a flag."""
    return np.atleast_1d(np.arange(ROW)[COLUMNS[topic]])


def digest(mission: str, way: str) -> str:
    """Digest of one flight: sha256 of its ticks, topic by topic in the order of their names.

    Only the first numbers of the topics in `NUMBERS` are in it.
    """
    name, changes = MISSIONS[mission]
    ends = {'dives': 0, 'duration_s': DURATION_S}
    scenario = load_scenario(name, {**changes, **WAYS[way], **ends})
    seen = hashlib.sha256()
    for log in fly_blocks(*mission_of(scenario)):
        for topic, count in NUMBERS.items():
            seen.update(np.ascontiguousarray(log[:, columns(topic)[:count]]).tobytes())
    return seen.hexdigest()[:32]


def table() -> dict:
    """Digests of all flights, and of the library they were made with."""
    flights = {f'{mission} {way}': digest(mission, way) for mission in MISSIONS for way in WAYS}
    short = {name: digest_of(name) for name in FLIGHTS}
    return {'probe': probe(), 'duration_s': DURATION_S, 'flights': flights, 'short': short}


@pytest.fixture(scope='module')
def made():
    """Table that the flights are compared with."""
    text = Path(__file__).with_name('flight_digests.json').read_text(encoding='utf-8')
    return json.loads(text)


def test_the_table_holds_every_flight(made):
    assert set(made['flights']) == {f'{mission} {way}' for mission in MISSIONS for way in WAYS}
    assert len(set(made['flights'].values())) == len(made['flights'])
    assert made['duration_s'] == DURATION_S


@pytest.mark.parametrize('mission', MISSIONS)
@pytest.mark.parametrize('way', WAYS)
def test_ten_hours_have_the_bits_that_they_had(made, mission, way):
    if probe() != made['probe']:
        pytest.skip('another mathematical library than the table was made with')
    assert digest(mission, way) == made['flights'][f'{mission} {way}']


@pytest.mark.parametrize('name', FLIGHTS)
def test_short_flights_have_the_bits_that_they_had(made, name):
    if probe() != made['probe']:
        pytest.skip('another mathematical library than the table was made with')
    assert digest_of(name) == made['short'][name]


#: What NumPy finds of this processor beyond what it takes for granted.
_FOUND = np.show_config(mode='dicts')['SIMD Extensions'].get('found', [])
_LONG = [name for name in _FOUND if name.startswith('AVX512')]
#: Kinds of processors, as OpenBLAS calls them, whose linear algebra this one can do.
_KINDS = {'Nehalem': True, 'Haswell': 'FMA3' in _FOUND, 'SkylakeX': 'AVX512_SKX' in _FOUND}


@pytest.mark.parametrize('kind', [kind for kind, is_here in _KINDS.items() if is_here])
def test_a_flight_has_the_bits_that_it_has_on_other_kinds_of_processors(kind):
    program = 'from mutants.trial import digest_of; print(digest_of("seaglider"))'
    paths = [str(Path(__file__).parent), os.environ.get('PYTHONPATH', '')]
    environment = {**os.environ, 'OPENBLAS_CORETYPE': kind, 'PYTHONPATH': os.pathsep.join(paths)}
    if kind != 'SkylakeX':
        environment['NPY_DISABLE_CPU_FEATURES'] = ' '.join(_LONG)
    done = subprocess.run(
        [sys.executable, '-c', program],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.strip() == digest_of('seaglider')


def test_each_short_flight_is_another_one(made):
    assert set(made['short']) == set(FLIGHTS)
    assert len(set(made['short'].values())) == len(FLIGHTS)


if __name__ == '__main__':
    print(json.dumps(table(), indent=2))
