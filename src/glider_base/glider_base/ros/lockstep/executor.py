# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""An executor that spends little on a message, and what nodes need to go with it.

The executors of rclpy make a new wait set of all entities for each message, which costs more than
everything else in a tick. `TickExecutor` keeps its wait set, hands messages of subscriptions in a
`Gate` straight to their callbacks, calls timers in one, and leaves all that is rare (services,
parameters, shutdown) to rclpy. A node waits for one input only, the one that comes last in a tick,
and takes the others by hand when that one is there.

Parts of this are not public in rclpy; they are those of Jazzy.
"""

from contextlib import ExitStack

from rclpy.callback_groups import CallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from glider_base.ros.hearing import gids

#: Kinds of entities beside subscriptions, by their collection in a node. Of these `TickExecutor`
#: handles itself what is a timer and in a gate.
_RARE = {'timers': 'timer', 'services': 'service', 'clients': 'client'}
_GUARDS = ('_guard', '_sigint_gc')
#: Kinds of what is ready, of which none is in a gate.
_RARELY = ('guard_condition', 'service', 'client')
_MESSAGE_ONLY = Subscription.CallbackType.MessageOnly
#: Waits no longer (s) than this, then looks whether its context is still good. rclpy answers a
#: signal by waking executors first and shutting contexts down after: one that was quicker would
#: wait for ever where no message comes any more.
_LOOK_S = 1.0


class Gate(CallbackGroup):
    """Lets the executor wait for the subscriptions in ``awaited`` only, and for all timers."""

    def __init__(self) -> None:
        super().__init__()
        self.awaited: set[Subscription] = set()

    def can_execute(self, entity) -> bool:
        """Whether the executor shall wait for it."""
        return entity in self.awaited or isinstance(entity, Timer)

    def beginning_execution(self, entity) -> bool:
        """Nothing to hold back: there is one thread."""
        return True

    def ending_execution(self, entity) -> None:
        """Nothing to let go."""


def take_with_info(subscription: Subscription) -> tuple | None:
    """Oldest message of a `Gate` subscription that no callback has had, and what is known of it.

    That is what a callback with two arguments gets: who published it (`gids.gid_of`), where the
    bytes are what is taken.
    """
    with subscription.handle:
        if subscription.raw and (taker := gids.taker()) is not None:
            return taker.take(subscription.handle.pointer)
        return subscription.handle.take_message(subscription.msg_type, subscription.raw)


def take(subscription: Subscription):
    """Oldest message of a `Gate` subscription that no callback has had, or None."""
    taken = take_with_info(subscription)
    return None if taken is None else taken[0]


def _call(timer: Timer) -> bool:
    """Begin the next period of a timer; not if a callback has ended or cancelled it meanwhile."""
    try:
        with timer.handle:
            is_due = timer.is_ready()
            if is_due:
                timer.handle.call_timer()
    except InvalidHandle:
        return False
    return is_due


class TickExecutor(SingleThreadedExecutor):
    """A SingleThreadedExecutor with a short way for the messages that ticks are made of."""

    def __init__(self, **kwargs) -> None:
        super().__init__(**kwargs)
        self._wait_set = None
        self._in_use = ExitStack()
        self._gated: list[Subscription] = []
        self._timers: list[Timer] = []
        self._others: list[tuple] = []

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait for something to do, and do it."""
        if self._wait_set is None:
            self._gather()
        ready, due, is_other_ready = self._wait(timeout_sec)
        for subscription in ready:
            taken = take_with_info(subscription)
            if taken is not None:
                wants_info = subscription._callback_type is not _MESSAGE_ONLY
                subscription.callback(*(taken if wants_info else taken[:1]))
        for timer in due:
            if _call(timer):
                timer.callback()
        if is_other_ready or not (ready or due):
            self._scatter()
            super().spin_once(timeout_sec=0.0)

    def can_execute(self, entity) -> bool:
        """Whether rclpy may see to it: not to what is in a gate, it would not tell by whom."""
        return not isinstance(entity.callback_group, Gate) and super().can_execute(entity)

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Stop executing callbacks."""
        self._scatter()
        return super().shutdown(timeout_sec)

    def _gather(self) -> None:
        """Make the wait set.

        It serves until something rare happens, because entities come and go only then. Events of
        the middleware (warnings about quality of service) are not in it: they wait for that too.
        """
        rare = [('guard_condition', getattr(self, name).handle) for name in _GUARDS]
        for node in self.get_nodes():
            for subscription in node.subscriptions:
                if isinstance(subscription.callback_group, Gate):
                    self._gated.append(subscription)
                else:
                    rare.append(('subscription', subscription.handle))
            for collection, kind in _RARE.items():
                for entity in getattr(node, collection):
                    if kind == 'timer' and isinstance(entity.callback_group, Gate):
                        self._timers.append(entity)
                    rare.append((kind, entity.handle))
        kinds = [kind for kind, _ in rare] + ['subscription'] * len(self._gated)
        handles = [handle for _, handle in rare] + [item.handle for item in self._gated]
        for handle in [*handles, self.context.handle]:
            self._in_use.enter_context(handle)
        order = ('subscription', 'guard_condition', 'timer', 'client', 'service', 'event')
        sizes = [kinds.count(kind) for kind in order]
        self._wait_set = _rclpy.WaitSet(*sizes, self.context.handle)
        self._others = [(getattr(self._wait_set, f'add_{kind}'), handle) for kind, handle in rare]

    def _scatter(self) -> None:
        """Forget the wait set, and let go of what was in it."""
        self._wait_set, self._others, self._gated, self._timers = None, [], [], []
        self._in_use.close()

    def _wait(self, timeout_sec: float | None) -> tuple[list[Subscription], list[Timer], bool]:
        """Wait until something is ready: what is so in gates, and whether anything else is."""
        wait_set = self._wait_set
        wait_set.clear_entities()
        gated = [item for item in self._gated if item.callback_group.can_execute(item)]
        for item in gated:
            wait_set.add_subscription(item.handle)
        for add, handle in self._others:
            add(handle)
        wait_set.wait(int(1e9 * (_LOOK_S if timeout_sec is None else timeout_sec)))
        came, rang = (set(wait_set.get_ready_entities(kind)) for kind in ('subscription', 'timer'))
        ready = [item for item in gated if item.handle.pointer in came]
        due = [item for item in self._timers if item.handle.pointer in rang] if rang else []
        is_other_ready = (
            len(ready) < len(came)
            or len(due) < len(rang)
            or any(wait_set.get_ready_entities(kind) for kind in _RARELY)
        )
        return ready, due, is_other_ready
