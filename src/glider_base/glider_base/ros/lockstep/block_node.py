# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The node of a block: everything that follows from what the block declares of itself."""

import math
import time
from typing import NamedTuple

from pydantic import Field
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin, LifecycleState, TransitionCallbackReturn

from glider_base.block import Block, Said, Telling, answer, optional_topics
from glider_base.errors import EXIT_FAILED, ConfigurationError
from glider_base.kernel import on_compiling
from glider_base.kernels.holding import Held
from glider_base.ros.lockstep import health
from glider_base.ros.lockstep.node import TickSettings
from glider_base.ros.lockstep.peers import FAREWELL_S
from glider_base.ros.lockstep.process import Stop
from glider_base.ros.lockstep.step_node import StepNode
from glider_base.ros.parameters import changed_parameters, declare_settings
from glider_base.settings import Settings
from glider_base.signals import TICK_NS, TICK_S, at_tick, not_finite, raised
from glider_base.slot import NOT_COMPILED
from glider_base.wiring import at_rest, not_fitted, present

RCLError = rclpy_implementation.RCLError


class BlockSettings(TickSettings):
    """How the node of a block keeps step."""

    managed: bool = Field(
        False, description='free-running: a managed (lifecycle) node, silent until it is activated'
    )


class BlockNode(StepNode, LifecycleNodeMixin):
    """A block that answers ticks. Subclasses call `start_up` at the end of their constructor.

    A managed one acts while it is active: `configure` forgets all that was learnt, `activate` and
    `deactivate` begin and end its cycles, `shutdown` ends it.
    """

    tick_settings = BlockSettings

    def __init__(self, block: Block, **kwargs) -> None:
        super().__init__(block.wired.node, **kwargs)
        self.block = block
        self.settings = declare_settings(self, block.settings, self.on_settings)
        self.steers_by = block.steers_by(self.settings)
        topics = optional_topics(self.settings)
        outputs = present(block.wired.outputs, topics)
        #: senders, and the places of what they send among the outputs of the block
        self.senders = [self.add_output(topic) for topic in outputs]
        self.sent = [block.wired.outputs.index(topic) for topic in outputs]
        #: what stands for inputs that there are not
        self.absent = [
            (i, not_fitted(topic))
            for i, topic in enumerate(block.wired.inputs)
            if topic not in present(block.wired.inputs, topics)
        ]
        self.params = self.settings.params()
        self.orders: dict[str, dict[str, str]] = {}  #: that it has followed since the last tick
        self.forget()
        for topic in present(block.wired.inputs, topics):
            self.add_input(topic)
        self.compile_kernels()

    def forget(self) -> None:
        """Know nothing, as at the start."""
        super().forget()
        self.held = Held(self.settings.initial_state(), self.params)
        self.telling = Telling(self.block)
        self.flags: tuple[int, ...] | None = None  #: of the last answer
        self.said: tuple[int, tuple] = (0, ())  #: its stamp, and the numbers
        self.wrong = ''  #: why there is none, in words

    @property
    def state(self) -> NamedTuple:
        """State of the block."""
        return self.held.state

    def on_ready(self) -> None:
        """Begin, or offer the services of a managed node."""
        if self.ticks.managed and not self.ticks.lockstep:
            LifecycleNodeMixin.__init__(self, enable_communication_interface=True)
            self._change_state = self._service_change_state.callback
            self._service_change_state.callback = self.on_change_state
            self.get_logger().info('managed: silent until it is configured and activated')
        else:
            super().on_ready()

    def on_change_state(self, request, response):
        """Serve ``change_state``; rclpy lets a transition that there is not end the process."""
        try:
            return self._change_state(request, response)
        except RCLError:
            response.success = False
            return response

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start from nothing, but for an order to come up."""
        try:
            self.forget()
        except ConfigurationError as error:  # of a law of somebody's own
            self.event(self._newest_ns(), health.ERROR, f'not configured: {error}')
            return TransitionCallbackReturn.FAILURE
        self.event(self._newest_ns(), health.OK, health.CONFIGURED)
        if self.orders.keys() & {health.ABORT, health.SURFACE}:
            self.held.state = self.block.surface(self.state)
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin."""
        self.begin()
        self.event(self._newest_ns(), health.OK, 'activated')
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Pause."""
        self.pause()
        self.event(self._newest_ns(), health.WARN, 'deactivated: silent until it is activated')
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Leave when the watch looks next: what is raised here is lost."""
        self.over_since_s = time.monotonic() - FAREWELL_S
        return TransitionCallbackReturn.SUCCESS

    def on_settings(self, settings: Settings) -> None:
        """Fly on with tunable parameters that were set at run time."""
        changed = changed_parameters(self.settings, settings)
        self.orders.setdefault(health.PARAMETERS_SET, {}).update(changed)
        self.settings = settings
        self.params = settings.params()
        self.held = Held(self.state, self.params)

    def compile_kernels(self) -> None:
        """Call every kernel once, so that no tick waits for the compiler."""
        inputs = tuple(at_rest(topic) for topic in self.block.wired.inputs)
        said = f'compiling the mathematics of {self.block.wired.name} for its settings, once'

        def tell() -> None:
            self.get_logger().info(said)

        with on_compiling(tell):
            state = self.state
            try:
                answer(self.held.held, 0.0, inputs, TICK_S)
            except (ConfigurationError, *NOT_COMPILED):
                raise
            except Exception:  # of a law of somebody's own: compiled it is, and a tick will tell
                pass
            self.held.state = state
            for order in self.block.orders:
                order(state)

    def surface(self, order: str) -> None:
        """Ask for the surface, for good; ``order`` says on /diagnostics who wanted it."""
        self.held.state = self.block.surface(self.state)
        self.orders.setdefault(order, {})

    def clear(self) -> None:
        """Forget what has latched."""
        self.held.state = self.block.clear(self.state)
        self.orders.setdefault(health.CLEAR, {})

    def step(self, stamp_ns: int, *inputs: tuple[float, ...]) -> None:
        """Answer one tick."""
        for order, values in self.orders.items():
            name = self.get_fully_qualified_name()
            self.publish_event(health.status_array(stamp_ns, name, health.OK, order, values))
        self.orders.clear()
        for place, values in self.absent:
            inputs = (*inputs[:place], values, *inputs[place:])
        for tick in range(stamp_ns // TICK_NS + 1 - self.passed, stamp_ns // TICK_NS + 1):
            try:
                outputs, self.flags = answer(self.held.held, tick * TICK_S, inputs, TICK_S)
                wrong = self.not_finite(outputs, tick)
            except Exception as error:  # of a law of somebody's own
                outputs, wrong = (), at_tick(raised(error), tick)
            if wrong and self.ticks.lockstep:
                raise Stop(EXIT_FAILED, wrong)
        if self.flags and self.block.say and self.telling.is_due(self.flags, stamp_ns):
            self.tell(stamp_ns, self.flags)
        if wrong and not self.wrong:
            self.event(stamp_ns, health.ERROR, f'{wrong}; silent until that is over')
        self.wrong = wrong
        self.said = stamp_ns, () if wrong else outputs
        self.repeat()

    def not_finite(self, outputs: tuple[tuple[float, ...], ...], tick: int) -> str:
        """What of an answer is not finite, in words; empty if all of it is."""
        for name, numbers in zip(self.block.wired.outputs, outputs, strict=True):
            if not all(map(math.isfinite, numbers)):
                return not_finite(f'{self.block.wired.name}: {name}', tick)
        return ''

    def condition(self) -> Said:
        """How this node is: what its block says."""
        condition = super().condition()
        if self.wrong:
            return Said('error', self.wrong)
        if self.flags is None or not self.block.say or condition.level != 'ok':
            return condition
        return self.block.say(*self.flags)

    def repeat(self) -> None:
        """Send the last answer, once more if no time has passed since."""
        stamp_ns, outputs = self.said
        for send, place in zip(self.senders, self.sent, strict=True):
            if outputs:
                send(stamp_ns, outputs[place])

    def tell(self, stamp_ns: int, flags: tuple[int, ...]) -> None:
        """Put a change of the flags on /diagnostics."""
        said = self.block.say(*flags)
        if said.level == 'error':
            self.get_logger().error(said.message)
        self.publish_event(health.said_array(stamp_ns, self.get_fully_qualified_name(), said))
