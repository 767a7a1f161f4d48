# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The four blocks one by one, fed with recorded inputs in compiled loops.

Inputs and outputs are what topics carry: one row of numbers per tick, as on the wire. A block
computes from them what its node would have published.
"""

from typing import NamedTuple

import numpy as np

from glider_bringup.direct import put
from glider_control.control import control_step, control_surface
from glider_control.settings import ControlSettings
from glider_guidance.guidance import guidance_abort, guidance_step
from glider_guidance.settings import GuidanceSettings
from glider_model.current import CurrentSettings, current_step
from glider_model.frames import (
    odometry_from_wire,
    odometry_to_wire,
    reference_from_wire,
    reference_to_wire,
    water_from_wire,
    water_to_wire,
    wrench_to_wire,
)
from glider_model.kernel import kernel
from glider_model.plant import (
    PlantSettings,
    plant_finished,
    plant_joints,
    plant_measurement,
    plant_step,
)
from glider_model.signals import TICK_NS, TICK_S, Joints

#: Numbers on a topic.
_ODOMETRY, _JOINTS, _VECTOR, _ADAPTATION = 13, 3, 3, 13


class BlockSettings(NamedTuple):
    """What the four blocks were told; None for a block of which it is not known."""

    plant: PlantSettings | None
    current: CurrentSettings | None
    guidance: GuidanceSettings | None
    control: ControlSettings | None


@kernel
def _plant(state, params, command, water, odom, joints, flags, dt):
    """Fill in all rows of ``odom``, ``joints`` and flags; the inputs may have one row less."""
    for k in range(len(odom)):
        put(odom, k, 0, odometry_to_wire(plant_measurement(state, params)))
        put(joints, k, 0, plant_joints(state))
        flags[k, 0] = plant_finished(state, params)
        if k < len(command):
            target = Joints(command[k, 0], command[k, 1], command[k, 2])
            state = plant_step(state, target, water_from_wire(water[k]), params, dt)
    return state


@kernel
def _current(state, params, stamps_ns, odom, water, dt):
    for k in range(len(odom)):
        odometry = odometry_from_wire(odom[k])
        position = (odometry.p_n, odometry.p_e, odometry.p_d)
        t_s = stamps_ns[k] // TICK_NS * TICK_S
        state, velocity = current_step(state, position, t_s, params, dt)
        put(water, k, 0, water_to_wire(velocity))
    return state


@kernel
def _guidance(state, params, odom, reference, error, estimate, flags, dt):
    for k in range(len(odom)):
        state, out = guidance_step(state, odometry_from_wire(odom[k]), params, dt)
        put(reference, k, 0, reference_to_wire(out.reference))
        put(error, k, 0, out.error)
        put(estimate, k, 0, water_to_wire(out.current))
        flags[k, 0] = out.stage
        flags[k, 1] = out.infeasible
    return state


@kernel
def _control(state, params, reference, odom, joints, command, wrench, adaptation, flags, dt):
    for k in range(len(odom)):
        state, out = control_step(
            state,
            odometry_from_wire(odom[k]),
            Joints(joints[k, 0], joints[k, 1], joints[k, 2]),
            reference_from_wire(reference[k]),
            params,
            dt,
        )
        put(command, k, 0, out.command)
        put(wrench, k, 0, wrench_to_wire(out.wrench))
        put(adaptation, k, 0, out.adaptation)
        flags[k, 0] = out.saturation
    return state


@kernel
def changes_to_tell(flags, stamps_ns, every_ns, told, told_ns):
    """Where a flag has changed, told at most once in ``every_ns``.

    Parameters
    ----------
    flags, stamps_ns : int64[n]
    every_ns : int
    told, told_ns : int
        The flag that was told last, and when.

    Returns
    -------
    int64[m]
        Indices.
    """
    found = np.empty(len(flags), np.int64)
    count = 0
    for k in range(len(flags)):
        if flags[k] != told and stamps_ns[k] - told_ns >= every_ns:
            told, told_ns = flags[k], stamps_ns[k]
            found[count] = k
            count += 1
    return found[:count]


class Block:
    """One block between two ticks.

    Attributes
    ----------
    settings : Settings
    state : tuple
        May be kept and put back.
    """

    name = ''
    inputs: tuple[str, ...] = ()  #: topics that it reads
    outputs: tuple[str, ...] = ()  #: per-tick topics that it publishes

    def __init__(self, settings) -> None:
        self.settings = settings
        self.params = settings.params()
        self.state = settings.initial_state()

    def tune(self, settings) -> None:
        """Fly on with other settings."""
        self.settings = settings
        self.params = settings.params()

    def run(self, stamps_ns: np.ndarray, inputs: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Work through some ticks.

        Parameters
        ----------
        stamps_ns : int64[n]
        inputs : dict of float64[n, m]
            Numbers by topic.

        Returns
        -------
        dict of float64[n, m]
            Numbers by topic; under ``'flags'`` what goes into events, int64[n, 2].
        """
        raise NotImplementedError


class PlantBlock(Block):
    """The plant. Its outputs of a tick are there before the inputs, which may lack at the end.

    The first flag says whether the run ends with the tick.
    """

    name = 'plant'
    inputs = ('command', 'current_velocity')
    outputs = ('/clock', 'odom', 'joint_states')

    def run(self, stamps_ns, inputs):
        """Odometry, joints and flags of each tick."""
        count = len(stamps_ns)
        odom, joints = np.empty((count, _ODOMETRY)), np.empty((count, _JOINTS))
        flags = np.zeros((count, 2), np.int64)
        command, water = (inputs[name] for name in self.inputs)
        self.state = _plant(self.state, self.params, command, water, odom, joints, flags, TICK_S)
        clock = np.empty((count, 0))
        return {'/clock': clock, 'odom': odom, 'joint_states': joints, 'flags': flags}


class CurrentBlock(Block):
    """The current field."""

    name = 'current'
    inputs = ('odom',)
    outputs = ('current_velocity',)

    def run(self, stamps_ns, inputs):
        """Water velocity at each tick."""
        water = np.empty((len(stamps_ns), _VECTOR))
        self.state = _current(self.state, self.params, stamps_ns, inputs['odom'], water, TICK_S)
        return {'current_velocity': water}


class GuidanceBlock(Block):
    """Guidance; flags are stage and infeasibility."""

    name = 'guidance'
    inputs = ('odom',)
    outputs = ('tracking_error', 'current_estimate', 'reference')

    def surface(self) -> None:
        """Do what the service ``abort`` does."""
        self.state = guidance_abort(self.state)

    def run(self, stamps_ns, inputs):
        """Reference, tracking error, estimate and flags of each tick."""
        count = len(stamps_ns)
        reference, flags = np.empty((count, _ODOMETRY)), np.zeros((count, 2), np.int64)
        error, estimate = np.empty((count, _VECTOR)), np.empty((count, _VECTOR))
        self.state = _guidance(
            self.state, self.params, inputs['odom'], reference, error, estimate, flags, TICK_S
        )
        return {
            'tracking_error': error,
            'current_estimate': estimate,
            'reference': reference,
            'flags': flags,
        }


class ControlBlock(Block):
    """Control; the flag is the saturation mask."""

    name = 'control'
    inputs = ('reference', 'odom', 'joint_states')
    outputs = ('wrench', 'adaptation', 'command')

    def surface(self) -> None:
        """Do what the node does whose input is lost."""
        self.state = control_surface(self.state)

    def run(self, stamps_ns, inputs):
        """Command, wrench, adaptation and flag of each tick."""
        count = len(stamps_ns)
        command, wrench = np.empty((count, _JOINTS)), np.empty((count, _VECTOR))
        adaptation, flags = np.empty((count, _ADAPTATION)), np.zeros((count, 2), np.int64)
        self.state = _control(
            self.state,
            self.params,
            *(inputs[name] for name in self.inputs),
            command,
            wrench,
            adaptation,
            flags,
            TICK_S,
        )
        return {'wrench': wrench, 'adaptation': adaptation, 'command': command, 'flags': flags}


#: In the order in which they act in a tick.
BLOCKS = (PlantBlock, CurrentBlock, GuidanceBlock, ControlBlock)
