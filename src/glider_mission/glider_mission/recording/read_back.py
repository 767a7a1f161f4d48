# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The rows of a bag, given to those who would have taken them in flight."""

from collections.abc import Callable, Iterable
from typing import Protocol

import numpy as np

from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.recorded_log import RecordedLog
from glider_model.vehicle.file import load_vehicle


class Reader(Protocol):
    """A taker that also says what it needs, so that no more is read from a bag."""

    topics: tuple[str, ...]  #: that it needs, beside those of the score

    def add(self, log: np.ndarray) -> None:
        """Take in the next rows, float64[n, ROW]; they are valid until the next are read."""


def read_back(
    bag: Bag,
    vehicle: str,
    takers: Iterable[Reader],
    progress: Callable[[int], None] = lambda ticks: None,
) -> RecordedLog:
    """Give the rows of a bag of a vehicle to takers; ``progress`` gets the ticks read.

    A `ConfigurationError` says where the bag is damaged.
    """
    takers = tuple(takers)
    also = {topic for taker in takers for topic in taker.topics}
    log = RecordedLog(bag, also, load_vehicle(vehicle).steers_by)
    for rows in log.blocks():
        for taker in takers:
            taker.add(rows)
        progress(log.ticks)
    return log
