# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A bag in memory: the numbers of its per-tick topics, its events, and what nodes were told."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message

from glider_bringup.blocks import BLOCKS
from glider_bringup.mission.run_folder import PARAMETERS_FILE, SCENARIO_FILE, VEHICLE_FILE
from glider_bringup.mission.scenario import Scenario, load_scenario
from glider_bringup.recording.mcap_reader import Bag
from glider_bringup.ros.bag_log import decode
from glider_model.base.files import read_yaml
from glider_model.base.settings import ConfigurationError, Settings
from glider_model.ros.parameters import from_parameters
from glider_model.ros.wire.codec import Codec
from glider_model.ros.wire.topics import TOPICS

#: Messages of foreign layout whose bytes are kept, for each topic.
_KEPT = 1000


class Series:
    """All messages of one per-tick topic, in the order of their log times.

    Attributes
    ----------
    stamps_ns : int64[n]
    values : float64[n, m]
    own : bool[n]
        Whether stamp and numbers are the whole message, byte by byte.
    raw : dict of bytes
        Messages that are not, by index; the first thousand of them.
    unusable : dict of str
        Why a node would refuse a message, by index.
    """

    def __init__(self, codec: Codec) -> None:
        self.codec = codec
        self.raw: dict[int, bytes] = {}
        self.unusable: dict[int, str] = {}
        self._blocks: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self._count = 0

    def add(self, batch, chosen: np.ndarray) -> None:
        """Take messages of a batch."""
        decoded = decode(self.codec, batch, chosen)
        for row in np.flatnonzero(~decoded.own)[: max(0, _KEPT - len(self.raw))]:
            self.raw[self._count + int(row)] = batch.payload(chosen[row])
        for row, why in decoded.unusable.items():
            self.unusable[self._count + row] = why
        self._blocks.append(decoded[:3])
        self._count += len(chosen)

    def close(self) -> None:
        """Make the arrays."""
        self.stamps_ns, self.values, self.own = (
            np.concatenate(arrays) for arrays in zip(*self._blocks, strict=True)
        )
        self._blocks.clear()

    def __len__(self) -> int:
        return self._count

    def payload(self, index: int) -> bytes:
        """Bytes of a message; empty if they were not kept."""
        if self.own[index]:
            return self.codec.encode(int(self.stamps_ns[index]), self.values[index])
        return self.raw.get(index, b'')


class Event(NamedTuple):
    """A message on /diagnostics."""

    stamp_ns: int
    node: str  #: name of its first status; '' if it cannot be read
    message: str
    values: dict[str, str]
    raw: bytes


class Recording:
    """A bag in memory.

    Parameters
    ----------
    bag : Bag
    namespace : str, optional
        Namespace of the nodes; may be left out if there is only one.
    progress : callable
        Called now and then with the share that is read, 0 to 1.

    Raises
    ------
    ConfigurationError
        If the bag holds no topic of ours or those of several namespaces, or is damaged.
    """

    def __init__(self, bag: Bag, namespace: str | None, progress: Callable[[float], None]) -> None:
        self.namespace = choose_namespace(bag, namespace)
        known = {topic.full_name(self.namespace): topic for topic in TOPICS.values()}
        known[self.node('clock')] = TOPICS['/clock']  # several gliders have a clock each
        self.series: dict[str, Series] = {}
        self.paths: list[bytes] = []
        self.events: list[Event] = []
        self.recorded = set()  #: names of topics that are there, with or without messages
        self.ignored: list[str] = []  #: topics that are not ours, or of another type
        takers: dict[int, Callable] = {}
        for index, recorded in enumerate(bag.topics):
            topic = known.get(recorded.name)
            if topic is None or recorded.type_name != topic.type_name:
                self.ignored.append(f'{recorded.name} ({recorded.type_name})')
                continue
            self.recorded.add(topic.name)
            if topic.per_tick:
                self.series[topic.name] = Series(topic.codec)
                takers[index] = self.series[topic.name].add
            elif topic.name == 'path':
                takers[index] = self._add_paths
            elif topic.name == '/diagnostics':
                takers[index] = self._add_events
        for batch in bag.batches():
            for index, take in takers.items():
                chosen = np.flatnonzero(batch.topic == index)
                if len(chosen):
                    take(batch, chosen)
            progress((batch.log_ns[-1] - bag.start_ns) / max(1, bag.end_ns - bag.start_ns))
        self.series = {name: series for name, series in self.series.items() if len(series)}
        for series in self.series.values():
            series.close()

    def node(self, name: str) -> str:
        """Full name of a node, as it stands on /diagnostics, or of a topic."""
        return f'{self.namespace.rstrip("/")}/{name}'

    def _add_paths(self, batch, chosen) -> None:
        self.paths += [batch.payload(index) for index in chosen]

    def _add_events(self, batch, chosen) -> None:
        for index in chosen:
            raw = batch.payload(index)
            try:
                array = deserialize_message(raw, DiagnosticArray)
                status = array.status[0]
            except Exception:  # damaged, or without a status
                self.events.append(Event(int(batch.log_ns[index]), '', '', {}, raw))
                continue
            stamp = array.header.stamp
            values = {pair.key: pair.value for pair in status.values}
            stamp_ns = stamp.sec * 1_000_000_000 + stamp.nanosec
            self.events.append(Event(stamp_ns, status.name, status.message, values, raw))


def choose_namespace(bag: Bag, given: str | None) -> str:
    """Namespace of the nodes in a bag, ``'/'`` for the root."""
    found = set()
    for recorded in bag.topics:
        for topic in TOPICS.values():
            if topic.name.startswith('/') or recorded.type_name != topic.type_name:
                continue
            if recorded.name.endswith('/' + topic.name):
                found.add(recorded.name.removesuffix(topic.name).rstrip('/') or '/')
    named = ', '.join(sorted(found))
    if given is not None:
        wanted = '/' + given.strip('/')
        if wanted not in found:
            raise ConfigurationError(
                f'--namespace {given}: nothing of it is in {bag.files[0]} '
                f'(allowed: {named or "none, it has no topic of these nodes"})'
            )
        return wanted
    if not found:
        topics = ', '.join(topic.name for topic in bag.topics) or 'none'
        cut = f'; {bag.cut}' if bag.cut else ''
        raise ConfigurationError(
            f'{bag.files[0]}: no topic of these nodes is recorded (recorded: {topics}){cut}'
        )
    if len(found) > 1:
        raise ConfigurationError(
            f'{bag.files[0]}: several namespaces are recorded: give --namespace (allowed: {named})'
        )
    return found.pop()


# ---------------------------------------------------------------------- what nodes were told


class Told(NamedTuple):
    """What the nodes of a recorded run were told."""

    blocks: dict[str, Settings | None]  #: by name of the block; None: it is not known
    source: str  #: where it stands
    lockstep: bool | None  #: None: it does not say
    note: str = ''


def read_told(bag: Bag, path: Path, file: Path | None, scratch: Path) -> Told:
    """Settings of the blocks of a recorded run.

    Parameters
    ----------
    bag : Bag
    path : Path
        Its folder or file. A scenario.yaml that lies there counts, else the one attached.
    file : Path, optional
        Scenario or parameter file that counts instead.
    scratch : Path
        Folder for attached files. It has to stay as long as the settings are used.

    Raises
    ------
    ConfigurationError
        If there are none, or they cannot be used.
    """
    folder = path if path.is_dir() else path.parent
    parameters = folder / PARAMETERS_FILE
    lockstep = _lockstep(read_yaml(parameters)) if parameters.is_file() else None
    if file is not None:
        values = read_yaml(file)
        if _is_parameters(values):
            return Told(_from_parameters(values, str(file)), str(file), _lockstep(values))
        return Told(_from_scenario(load_scenario(str(file), recorded=True)), str(file), lockstep)
    attached = bag.attachments.get(SCENARIO_FILE)
    beside = folder / SCENARIO_FILE
    if beside.is_file():
        differs = attached is not None and attached != beside.read_bytes()
        note = f'{beside} is not the scenario that is attached to the bag' if differs else ''
        return Told(
            _from_scenario(load_scenario(str(beside), recorded=True)), str(beside), lockstep, note
        )
    if attached is not None:
        for name in (SCENARIO_FILE, VEHICLE_FILE):
            (scratch / name).write_bytes(bag.attachments.get(name, b''))
        try:
            blocks = _from_scenario(load_scenario(str(scratch / SCENARIO_FILE), recorded=True))
        except ConfigurationError as error:
            text = str(error).replace(f'{scratch}/', f'{bag.files[0]}: attached ')
            raise ConfigurationError(text) from None
        return Told(blocks, f'{SCENARIO_FILE} attached to {bag.files[0]}', lockstep)
    if parameters.is_file():
        values = read_yaml(parameters)
        return Told(_from_parameters(values, str(parameters)), str(parameters), lockstep)
    raise ConfigurationError(
        f'{path}: it does not say what the nodes were told, neither {SCENARIO_FILE} nor '
        f'{PARAMETERS_FILE} is in it or attached: give --settings FILE'
    )


def _from_scenario(scenario: Scenario) -> dict[str, Settings | None]:
    settings = zip(BLOCKS, scenario.block_settings(), strict=True)
    return {block.wired.name: one for block, one in settings}


def _sections(values: dict) -> dict[str, dict]:
    """Parameters by node name; those under a wildcard under ``'**'``."""
    return {
        str(key).rstrip('/').rpartition('/')[2]: section['ros__parameters']
        for key, section in values.items()
        if isinstance(section, dict) and isinstance(section.get('ros__parameters'), dict)
    }


def _is_parameters(values: dict) -> bool:
    return bool(_sections(values))


def _lockstep(values: dict) -> bool | None:
    """Whether the nodes of a parameter file keep step; None if it does not say."""
    said = [section.get('lockstep') for section in _sections(values).values()]
    said = [one for one in said if isinstance(one, bool)]
    return all(said) if said else None


def _from_parameters(values: dict, source: str) -> dict[str, Settings | None]:
    sections = _sections(values)
    found: dict[str, Settings | None] = {}
    for block in BLOCKS:
        node = block.wired.node
        given = {**sections.get('**', {}), **sections.get(node, {})}
        told = node in sections or '**' in sections
        settings = from_parameters(block.settings, given, f'{source}: {node}') if told else None
        found[block.wired.name] = settings
    return found
