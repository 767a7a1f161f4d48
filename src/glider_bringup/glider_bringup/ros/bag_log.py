# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Bags to log rows and back: what lets one function score and draw every kind of run."""

import struct
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from mcap.exceptions import McapError
from mcap.reader import McapReader, NonSeekingReader, SeekingReader
from mcap.summary import Summary
from rclpy.serialization import deserialize_message

from glider_bringup.blocks import changes_to_tell
from glider_bringup.direct import BLOCK_TICKS, COLUMNS, ROW
from glider_bringup.ros.bag import BagWriter
from glider_control.nodes.control_node import TELL_EVERY_NS, saturation_event
from glider_guidance.nodes.guidance_node import path_message, stage_event
from glider_guidance.profile import STAGE_NAMES
from glider_model.ros import health, messages
from glider_model.ros.codec import to_cdr
from glider_model.ros.messages import TOPICS
from glider_model.settings import ConfigurationError
from glider_model.signals import TICK_NS

_GUIDANCE, _CONTROL, _PLANT = (
    f'/glider/{node}' for node in (messages.GUIDANCE, messages.CONTROL, messages.PLANT)
)
_PER_TICK = [topic for topic in TOPICS.values() if topic.per_tick]

#: What readers raise where a file ends too early.
_CUT = (McapError, struct.error, EOFError)

#: Topics that the score is computed from.
SCORED = ('odom', 'joint_states', 'reference', 'tracking_error')


class LogWriter:
    """Writes the log rows of a direct run as the messages that the nodes would have published."""

    def __init__(self, bag: BagWriter, path_points: np.ndarray) -> None:
        self._bag = bag
        self._tick = 0
        self._told: tuple[int, bool] | None = None
        self._saturation, self._saturation_ns = 0, -TELL_EVERY_NS
        bag.write('path', 0, to_cdr(path_message(path_points)))

    def add(self, log: np.ndarray) -> None:
        """Add a block of rows, float64[n, ROW]."""
        stamps = (np.arange(len(log)) + self._tick) * TICK_NS
        self._tell(stamps, log)
        payloads = {}
        for topic in _PER_TICK:
            values = log[:, COLUMNS[topic.name]] if topic.name in COLUMNS else log[:, :0]
            payloads[topic.name] = topic.codec.encode_many(stamps, values)
        self._bag.write_ticks(stamps, payloads)
        self._tick += len(log)

    def _tell(self, stamps: np.ndarray, log: np.ndarray) -> None:
        """Write the diagnostics of each change of stage, feasibility or saturation."""
        flags = log[:, [COLUMNS['stage'], COLUMNS['infeasible']]]
        changed = np.flatnonzero(np.any(flags[1:] != flags[:-1], axis=1)) + 1
        for row in (0, *changed):
            now = (int(flags[row, 0]), bool(flags[row, 1]))
            if now != self._told:
                self._told = now
                stamp = int(stamps[row])
                self._bag.write('/diagnostics', stamp, to_cdr(stage_event(stamp, *now, _GUIDANCE)))
        saturation = log[:, COLUMNS['saturation']].astype(np.int64)
        for row in changes_to_tell(
            saturation, stamps, TELL_EVERY_NS, self._saturation, self._saturation_ns
        ):
            self._saturation, self._saturation_ns = int(saturation[row]), int(stamps[row])
            event = saturation_event(self._saturation_ns, self._saturation, _CONTROL)
            self._bag.write('/diagnostics', self._saturation_ns, to_cdr(event))

    def finish(self) -> None:
        """Write that the run is complete, as the plant says it after the last tick."""
        stamp_ns = (self._tick - 1) * TICK_NS
        report = health.Report(_PLANT, health.FINISHED, health.COMPLETE, stamp_ns)
        self._bag.write('/diagnostics', stamp_ns, to_cdr(health.report_array(report)))

    def close(self) -> int:
        """Complete the bag; the number of messages in it."""
        self._bag.close()
        return sum(self._bag.counts.values())


def has_bag(run: Path) -> bool:
    """Whether a run folder holds a bag, or is one: a single MCAP file."""
    return run.is_file() or any(run.glob('*.mcap'))


def _file(run: Path) -> Path:
    """The one MCAP file of a run folder, or the file that was given in its place."""
    files = [run] if run.is_file() else sorted(run.glob('*.mcap'))
    if len(files) != 1:
        raise ConfigurationError(f'{run}: expected one .mcap file, found {len(files)}')
    return files[0]


def _known_name(topic: str) -> str | None:
    """Our name of a recorded topic, whatever its namespace."""
    for name in TOPICS:
        if topic == name or topic.endswith('/' + name.lstrip('/')):
            return name
    return None


def _summary(stream: IO[bytes]) -> Summary | None:
    """Summary at the end of a file, if its writer got so far; the stream is at its start again."""
    try:
        return SeekingReader(stream).get_summary()
    except (*_CUT, OSError):
        return None
    finally:
        stream.seek(0)


def _messages(file: Path, names: Iterable[str]) -> Iterator[tuple[str, int, bytes]]:
    """Name, log time (ns) and payload of the messages on some topics, chunk by chunk.

    In order of time, or in that of the file if its writer was killed: such a file has no summary
    and ends anywhere; it is read up to its last whole chunk. With a summary it is the order of
    time that keeps mcap from reading all chunks before it gives the first message.
    """
    wanted = set(names)
    with file.open('rb') as stream:
        summary = _summary(stream)
        topics = None
        reader: McapReader = NonSeekingReader(stream)
        if summary is not None:
            reader = SeekingReader(stream)
            topics = [
                channel.topic
                for channel in summary.channels.values()
                if _known_name(channel.topic) in wanted
            ]
        try:
            in_order = summary is not None
            for _, channel, message in reader.iter_messages(topics, log_time_order=in_order):
                name = _known_name(channel.topic)
                if name in wanted:
                    yield name, message.log_time, message.data
        except _CUT as error:
            if summary is not None:
                raise ConfigurationError(f'{file}: damaged: {error}') from None


def _diagnostics(file: Path) -> Iterator[DiagnosticArray]:
    """Messages on /diagnostics."""
    for _, _, payload in _messages(file, ['/diagnostics']):
        yield deserialize_message(payload, DiagnosticArray)


def _flag_changes(file: Path) -> list[tuple[int, str, float]]:
    """Tick, column and new value of changes of stage and feasibility, from /diagnostics."""
    read = {'infeasible': lambda text: text == 'true', 'stage': _stage_number}
    return [
        (health.stamp_of(array) // TICK_NS, pair.key, float(read[pair.key](pair.value)))
        for array in _diagnostics(file)
        for status in array.status
        for pair in status.values
        if pair.key in read
    ]


def _stage_number(name: str) -> float:
    """Number of a stage; NaN for one that this version does not know."""
    return STAGE_NAMES.index(name) if name in STAGE_NAMES else np.nan


def end_of_run(run: Path) -> tuple[bool, str]:
    """Whether the plant said in a bag that the run is complete; if not, what it said instead."""
    for array in _diagnostics(_file(run)):
        report = health.end_of_run(array)
        if report:
            complete = report.phase == health.FINISHED
            return complete, '' if complete else report.message
    return False, 'the recording was stopped before the run was complete'


def attachments(run: Path) -> dict[str, bytes]:
    """Files that are stored in a bag, by name."""
    with _file(run).open('rb') as stream:
        whole = _summary(stream) is not None
        reader: McapReader = SeekingReader(stream) if whole else NonSeekingReader(stream)
        found = {}
        with suppress(*_CUT):  # of a file that was cut short, whatever comes before its end
            for attachment in reader.iter_attachments():
                found[attachment.name] = attachment.data
    return found


def read_blocks(run: Path, also: Iterable[str] = ()) -> Iterator[np.ndarray]:
    """Log rows of a bag, as the direct engine would have given them.

    Parameters
    ----------
    run : Path
        Run folder, or its MCAP file.
    also : iterable of str
        Topics to read beside `SCORED`, NaN in ticks that lack them. The columns of all other
        topics and saturation are NaN.

    Yields
    ------
    float64[n, ROW]
        Rows of consecutive ticks, until the first tick that lacks one of `SCORED`; valid until
        the next are asked for.

    Raises
    ------
    ConfigurationError
        If there is no bag, or it is damaged.
    """
    file = _file(run)
    wanted = {
        name: (TOPICS[name].codec, COLUMNS[name], name in SCORED) for name in (*SCORED, *also)
    }
    changes = _flag_changes(file)
    log = np.full((2 * BLOCK_TICKS, ROW), np.nan)
    seen = np.zeros(2 * BLOCK_TICKS, dtype=np.int64)
    start = 0

    def finish() -> Iterator[np.ndarray]:
        """The first block up to a tick that lacks something; then the second takes its place."""
        nonlocal start
        missing = np.flatnonzero(seen[:BLOCK_TICKS] != len(SCORED))
        rows = int(missing[0]) if len(missing) else BLOCK_TICKS
        log[:rows, COLUMNS['infeasible']] = 0.0
        for tick, column, value in changes:
            log[max(0, tick - start) : rows, COLUMNS[column]] = value
        yield log[:rows]
        log[:BLOCK_TICKS], log[BLOCK_TICKS:] = log[BLOCK_TICKS:], np.nan
        seen[:BLOCK_TICKS], seen[BLOCK_TICKS:] = seen[BLOCK_TICKS:], 0
        start += BLOCK_TICKS
        return rows == BLOCK_TICKS

    for name, _, payload in _messages(file, wanted):
        codec, columns, is_scored = wanted[name]
        stamp_ns, values = codec.decode(payload)
        tick = stamp_ns // TICK_NS
        while tick - start >= 2 * BLOCK_TICKS:  # a recorder from outside keeps no strict order
            if not (yield from finish()):
                return
        if tick >= start:
            log[tick - start, columns] = values
            seen[tick - start] += is_scored
    if (yield from finish()):
        yield from finish()


def recorded_and_lost(folder: Path, complete: bool) -> tuple[int, int]:
    """Number of messages in a bag, and of per-tick messages that ought to be but are not.

    A run that was cut short (``complete`` is false) may lack messages of its last two ticks, which
    is not a loss: a node that ended within a tick may have let the others begin the next one.
    """
    file = _file(folder)
    with file.open('rb') as stream:
        summary = _summary(stream)
    counts = dict.fromkeys((topic.name for topic in _PER_TICK), 0)
    if summary is None:
        for name, _, _ in _messages(file, TOPICS):
            counts[name] = counts.get(name, 0) + 1
    else:
        recorded = summary.statistics.channel_message_counts
        for number, channel in summary.channels.items():
            name = _known_name(channel.topic) or channel.topic
            counts[name] = recorded.get(number, 0)
    per_tick = [counts[topic.name] for topic in _PER_TICK]
    ticks = max(per_tick)
    expected = ticks if complete else ticks - 2
    lost = sum(max(0, expected - count) for count in per_tick)
    return sum(counts.values()), lost
