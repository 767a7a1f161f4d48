# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A run over ROS 2 topics and a direct run of one scenario are identical to the last bit."""

import hashlib
import json
from pathlib import Path

import pytest
from mcap.reader import make_reader

from glider_model.ros.messages import TOPICS
from glider_model.signals import TICK_S

PER_TICK = [topic.full_name('/glider') for topic in TOPICS.values() if topic.per_tick]

#: What tells how a result came about, not what it is.
HOW = {'engine', 'wall_time_s', 'real_time_factor', 'messages_recorded'}


def digests(folder: Path) -> dict[str, tuple[int, str]]:
    """Number of messages of each per-tick topic, and a digest of their stamps and payloads."""
    counts, hashes = dict.fromkeys(PER_TICK, 0), {name: hashlib.sha256() for name in PER_TICK}
    (file,) = folder.glob('*.mcap')
    with file.open('rb') as stream:
        for _, channel, message in make_reader(stream).iter_messages(topics=PER_TICK):
            counts[channel.topic] += 1
            hashes[channel.topic].update(message.log_time.to_bytes(8, 'big') + message.data)
    return {name: (counts[name], hashes[name].hexdigest()) for name in PER_TICK}


def test_flight_is_what_it_was_meant_to_be(over_nodes):
    card = over_nodes.card
    assert (card['engine'], card['status'], card['reason']) == ('nodes', 'completed', '')
    assert card['ticks'] * TICK_S == pytest.approx(card['sim_time_s']) == pytest.approx(2000.0)
    assert card['messages_lost'] == 0
    assert card['messages_recorded'] > card['ticks'] * len(PER_TICK)
    assert card['depth_m']['max'] > 300.0
    assert card['distance_along_path_m'] > 500.0


def test_final_state_and_scores_are_identical(over_nodes, direct):
    assert direct.card['engine'] == 'direct'
    assert over_nodes.card.keys() == direct.card.keys()
    nodes, engine = (
        {name: value for name, value in flight.card.items() if name not in HOW}
        for flight in (over_nodes, direct)
    )
    assert nodes == engine


def test_recorded_payloads_are_identical(over_nodes, direct):
    nodes = digests(over_nodes.folder)
    assert all(count == over_nodes.card['ticks'] for count, _ in nodes.values())
    assert nodes == digests(direct.folder)


@pytest.mark.parametrize('flight', ['over_nodes', 'direct'])
def test_score_from_the_bag_is_the_score_of_the_run(glider, request, flight):
    recorded = request.getfixturevalue(flight)
    done = glider('score', recorded.folder, '--json')
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == recorded.card
