# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flights that leave a bag in their run folder: by the direct engine, or over nodes."""

from collections.abc import Callable, Iterable
from pathlib import Path

from glider_base.errors import EXIT_USAGE
from glider_base.ros.places import NAMESPACE
from glider_base.ros.wire.topics import recorded_topics
from glider_base.settings import ConfigurationError
from glider_bringup.engines.flight import (
    Outcome,
    Progress,
    Sink,
    ended,
    fly,
    refuse_message_faults,
)
from glider_bringup.engines.node_parameters import node_parameters, write_parameters
from glider_bringup.engines.processes import Layout, node_commands, run_nodes
from glider_mission.disk import DiskError, vanished
from glider_mission.planned import refuse_planned_route
from glider_mission.recording.bag_files import has_bag
from glider_mission.recording.mcap_reader import Bag
from glider_mission.recording.ros.log_writer import LogWriter
from glider_mission.recording.ros.recorded_log import Reader, read_back
from glider_mission.recording.ros.rosbag2 import BagWriter, Sync
from glider_mission.run_folder import LOG_FILE, PARAMETERS_FILE, SCENARIO_FILE, VEHICLE_FILE
from glider_mission.scenario import Scenario
from glider_model.vehicle.file import steers_by


def fly_recorded(
    scenario: Scenario,
    folder: Path,
    sinks: Iterable[Sink] = (),
    progress: Progress | None = None,
    sync: Sync = 'end',
) -> Outcome:
    """Fly with the direct engine, as `fly` does, and write the bag of the run."""
    refuse_message_faults(scenario)
    refuse_planned_route(scenario)
    attachments = [folder / SCENARIO_FILE, folder / VEHICLE_FILE]
    topics = scenario.topics
    recorded = recorded_topics(topics)
    bag = BagWriter(folder, scenario.name, attachments=attachments, topics=recorded, sync=sync)
    writer = LogWriter(bag, scenario.guidance_settings(), topics, steers_by(scenario))
    try:
        flight = fly(scenario, [*sinks, writer], progress)
    except ConfigurationError:  # such as a law that cannot be compiled
        bag.discard()
        raise
    try:
        if flight.status != 'aborted':
            writer.finish(flight.reason)
        bag.close()
    except DiskError as error:
        if not flight.reason:
            flight = flight._replace(status=ended(False, str(error)), reason=str(error))
    return flight._replace(messages_recorded=sum(bag.counts.values()))


def fly_nodes(
    scenario: Scenario,
    folder: Path,
    sinks: Iterable[Reader] = (),
    progress: Progress | None = None,
    *,
    speed: float = 0.0,
    namespace: str | None = None,
    on_log: Callable[[str], None] = lambda line: None,
    on_read: Callable[[int], None] = lambda ticks: None,
    sync: Sync = 'end',
    layout: Layout = 'together',
) -> Outcome:
    """Fly over nodes and topics; what sinks are given is read back from the bag.

    ``speed`` is in times real time, 0.0 as fast as possible. Nodes in a namespace of their own
    have their clock in it. ``on_log`` gets each line that a node prints, ``on_read`` the ticks
    that have been read back; ``sync`` says when the bag is synced to disk, ``layout`` which nodes
    share a process.
    """
    refuse_planned_route(scenario)
    attachments = (folder / SCENARIO_FILE, folder / VEHICLE_FILE)
    as_flown = scenario.model_copy(update={'vehicle': str((folder / VEHICLE_FILE).resolve())})
    parameters = node_parameters(
        as_flown, speed=speed, record_to=folder, attachments=attachments, sync=sync
    )
    place = namespace or NAMESPACE
    write_parameters(parameters, folder / PARAMETERS_FILE, place)

    result = run_nodes(
        node_commands(folder / PARAMETERS_FILE, place, namespace is not None, layout),
        folder / LOG_FILE,
        on_log,
        progress and (lambda said: progress(said['tick'], said['depth_m'])),
    )
    if result.exit_code == EXIT_USAGE:
        raise ConfigurationError(result.reason)
    completed, reason = result.status == 'completed', result.reason
    recorded, lost = 0, 0
    if has_bag(folder):  # else it ended before the recorder was up
        log = read_back(Bag(folder), scenario.vehicle, sinks, on_read)
        if completed and (missing := log.missing(None)):
            completed, reason = False, missing
        recorded, lost = sum(log.counts.values()), log.lost(completed)
    elif completed:
        completed, reason = False, str(vanished(folder))
    return Outcome(ended(completed, reason), reason, result.flight_s, recorded, lost)
