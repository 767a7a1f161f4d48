# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Whose a topic is, when what the middleware knows of a node comes late or stays for long."""

import pytest

from glider_base.ros.hearing.owner import NAMED_WITHIN_S, Owner, Verdict
from glider_base.ros.wire.topics import TOPICS

NAME, PATIENCE_S = '/glider/driver', 1.0
FIRST, SECOND = (bytes([1, 15, *[process] * 8, 0, 0, 0, 0, 3, 0]) for process in (1, 2))


def claimed(owner, gid, names, now_s):
    return owner.claimed(gid, names, '/glider', now_s, PATIENCE_S)


@pytest.fixture
def owner():
    return Owner(TOPICS['odom'], False)


@pytest.mark.parametrize('known_s', [0.0, 1.0])
@pytest.mark.parametrize('is_listed', [True, False])
def test_who_was_before_is_known_though_its_name_came_late(owner, known_s, is_listed):
    assert claimed(owner, FIRST, {FIRST: NAME if known_s == 0.0 else ''}, 0.0) is Verdict.OWNED
    assert owner.owns(FIRST, 1.0)
    names = {SECOND: NAME} | ({FIRST: NAME} if is_listed else {})
    assert claimed(owner, SECOND, names, 5.0) is Verdict.TAKEN_OVER
    assert owner.gid == SECOND and owner.name == NAME
    assert owner.before == (NAME if known_s == 0.0 or is_listed else '')


def test_a_name_is_not_forgotten_by_who_lists_it_no_more(owner):
    claimed(owner, FIRST, {FIRST: NAME}, 0.0)
    assert claimed(owner, SECOND, {FIRST: '', SECOND: NAME}, 5.0) is Verdict.TAKEN_OVER
    assert owner.before == NAME


def test_a_second_of_the_same_name_is_no_successor_while_the_first_is_heard(owner):
    claimed(owner, FIRST, {FIRST: NAME}, 0.0)
    both = {FIRST: NAME, SECOND: NAME}
    assert claimed(owner, SECOND, both, 0.5) is Verdict.DOUBTFUL
    assert owner.owns(FIRST, 0.6)
    assert claimed(owner, SECOND, both, 5.0) is Verdict.STRANGE


@pytest.mark.parametrize('is_listed', [True, False])
def test_a_successor_whose_name_comes_late_is_refused_when_it_should_be_known(owner, is_listed):
    claimed(owner, FIRST, {FIRST: NAME}, 0.0)
    names = {FIRST: NAME} | ({SECOND: ''} if is_listed else {})
    assert claimed(owner, SECOND, names, 5.0) is Verdict.DOUBTFUL
    assert claimed(owner, SECOND, names, 5.0 + NAMED_WITHIN_S) is Verdict.STRANGE
    assert claimed(owner, SECOND, {SECOND: NAME}, 20.0) is Verdict.TAKEN_OVER
    assert owner.before == NAME


def test_who_has_no_name_is_a_stranger_while_the_owner_is_heard(owner):
    claimed(owner, FIRST, {FIRST: NAME}, 0.0)
    assert claimed(owner, SECOND, {FIRST: NAME}, 0.5) is Verdict.DOUBTFUL
    assert owner.owns(FIRST, 0.6)
    assert claimed(owner, SECOND, {FIRST: NAME}, 0.7) is Verdict.STRANGE
