# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the tests of all packages have in common: pytest looks here from each of their folders."""

import gc
import signal

import pytest
from hypothesis import settings

gc.set_threshold(100_000)  # what is imported and compiled stays
# an example may wait for a compiler, or for a processor that others use
settings.register_profile('glider', deadline=None)
settings.load_profile('glider')


@pytest.fixture
def context(monkeypatch):
    """Context of rclpy in a ROS domain of its own; handlers of signals stay as they were."""
    import rclpy
    from rclpy.context import Context

    from glider_base.ros.places import domain_id

    monkeypatch.delenv('ROS_DOMAIN_ID', raising=False)
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    context = Context()
    with domain_id() as domain:
        rclpy.init(context=context, domain_id=domain)
        yield context
        rclpy.try_shutdown(context=context)
    for number, handler in before.items():
        signal.signal(number, handler)
