# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Shows a run in Foxglove while it flies: a WebSocket server with every topic that is recorded.

Nothing waits for it. It asks for best-effort delivery of the newest message of each per-tick
topic, looks at them 50 times a second of wall time, and passes on what is new: all of a run at up
to 5 times real time, samples of a faster one.
"""

import select
import signal
import struct
import sys
import time
from collections import deque
from types import SimpleNamespace

import rclpy
from pydantic import Field
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy

from glider_base.errors import EXIT_USAGE, say_fatal
from glider_base.ros.lockstep.executor import take
from glider_base.ros.parameters import declare_settings, refuse_unknown
from glider_base.ros.wire import qos
from glider_base.ros.wire.topics import TOPICS
from glider_base.settings import ConfigurationError, Settings
from glider_mission.recording.ros.rosbag2 import message_definition

NAME = 'viewer_node'
_PERIOD_S = 0.02
#: Every recorded message begins with its stamp, behind the four bytes of the CDR header.
_STAMP = struct.Struct('<4xiI')


class ViewerSettings(Settings):
    """Where the run is shown."""

    port: int = Field(8765, ge=1, le=65535, description='port of the WebSocket server')
    host: str = Field('127.0.0.1', description='address that it listens on')
    led: bool = Field(
        False, description='standard input leads: look at topics after a line, leave at its end'
    )


class ViewerNode(Node):
    """Takes all topics raw, and passes them on to Foxglove."""

    def __init__(self, **kwargs) -> None:
        super().__init__(NAME, **kwargs)
        self.settings = declare_settings(self, ViewerSettings)
        try:
            import foxglove
        except ImportError as error:
            raise ConfigurationError(
                f'the live view needs the Python package foxglove-sdk, which does not load here '
                f'({error}); everything else works without it'
            ) from None
        foxglove.set_log_level('ERROR')
        self.asked: deque[str] = deque()  #: topics of new subscriptions, by another thread
        listener = SimpleNamespace(
            on_subscribe=lambda _, channel: self.asked.append(channel.topic)
        )
        self.shown = foxglove.Context()  # the server serves it for as long as it is held
        self.channels = {}
        self.topics = {
            topic.full_name(self.get_namespace()): topic
            for topic in TOPICS.values()
            if topic.recorded
        }
        self.held = {
            name: deque(maxlen=topic.qos.depth)
            for name, topic in self.topics.items()
            if topic.qos.durability is DurabilityPolicy.TRANSIENT_LOCAL
        }
        for name, topic in self.topics.items():
            text = message_definition(topic.type_name).encode()
            schema = foxglove.Schema(name=topic.type_name, encoding='ros2msg', data=text)
            self.channels[name] = foxglove.Channel(
                name, schema=schema, message_encoding='cdr', context=self.shown
            )
        try:
            self.server = foxglove.start_server(
                name='glider',
                host=self.settings.host,
                port=self.settings.port,
                capabilities=[foxglove.Capability.Time],
                server_listener=listener,
                context=self.shown,
            )
        except RuntimeError as error:
            raise ConfigurationError(
                f'port {self.settings.port} of {self.settings.host} cannot be used for the live '
                f'view: {error}'
            ) from None
        self.incoming = {}
        print(f'ready {self.server.app_url()}', flush=True)

    def look(self) -> None:
        """Subscribe to all topics."""
        for name, topic in self.topics.items():
            profile = qos.NEWEST if topic.per_tick else topic.qos
            self.incoming[name] = self.create_subscription(
                topic.message_type,
                name,
                lambda raw: None,
                profile,
                event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
                raw=True,
            )

    def pass_on(self) -> None:
        """Send what is new, and what a client has missed of topics that are latched."""
        while self.asked:
            name = self.asked.popleft()
            for raw in self.held.get(name, ()):
                self.send(name, raw)
        for name, subscription in self.incoming.items():
            while (raw := take(subscription)) is not None:
                if len(raw) < _STAMP.size:
                    continue  # bytes that are no message
                if name in self.held:
                    self.held[name].append(raw)
                self.send(name, raw)

    def send(self, name: str, raw: bytes) -> None:
        """Send a message under the simulated time that it carries."""
        sec, nanosec = _STAMP.unpack_from(raw)
        stamp_ns = max(0, sec) * 1_000_000_000 + nanosec
        self.channels[name].log(raw, log_time=stamp_ns)
        if name == '/clock':
            self.server.broadcast_time(stamp_ns)

    def run(self) -> None:
        """Pass on messages until asked to leave."""
        if not self.settings.led:
            self.look()
        while rclpy.ok():
            if not self.settings.led:
                time.sleep(_PERIOD_S)
            elif select.select([sys.stdin], [], [], _PERIOD_S)[0]:
                if not sys.stdin.readline():
                    return
                self.look()
            self.pass_on()


def main(args=None) -> int:
    """Run the node; returns its exit code."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    rclpy.init(args=args)
    try:
        node = ViewerNode()
        refuse_unknown(node)
        node.run()
        node.pass_on()
        node.server.stop()
    except ConfigurationError as error:
        say_fatal(error)
        return EXIT_USAGE
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
