# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What the guard watches for, row by row, and what it does about it.

A row is a bit of the report. Rows that latch stay until a person clears them at the surface. The
reaction of the vehicle is the gravest among the rows that are reported.
"""

from typing import NamedTuple

from glider_base.kernel import kernel

#: Reactions by gravity. note: tell it; hold: no roll and no rudder, the dive goes on; surface: the
#: whole pump and the mass at its climb stop, open loop; drop: and let the weight go.
NONE, NOTE, HOLD, SURFACE, DROP = range(5)
REACTIONS = ('none', 'note', 'hold', 'surface', 'drop')


class Row(NamedTuple):
    """One thing that is watched for; docs/safety.md tells when it holds, and by what fields."""

    bit: int
    name: str
    says: str  #: on /diagnostics
    reaction: int = SURFACE

    @property
    def latches(self) -> bool:
        """Whether it stays until a person clears it: what ends a mission does."""
        return self.reaction >= SURFACE


STUCK_BUOYANCY, STUCK_PITCH, STUCK_ROLL, STUCK_SURFACE = 8, 16, 32, 2048
ORDERED, TOO_DEEP, FROZEN, LOST = 128, 256, 512, 1024
OVERDEPTH, CRUSHING, NOT_CLIMBING, NOT_RISING = 1 << 13, 1 << 14, 1 << 15, 1 << 16
STALLED, NO_DEMAND, DISAGREES, UNDER_LONG = 1 << 17, 1 << 18, 1 << 19, 1 << 20
LEAK, VACUUM, BATTERY, NO_CONTACT = 1 << 21, 1 << 22, 1 << 23, 1 << 24
TOO_HEAVY, NEAR_BOTTOM = 1 << 25, 1 << 26
DEPTH_OFFSET, DEPTH_WRONG = 1 << 28, 1 << 29
ASTRAY, CONTRADICTED = 1 << 27, 1 << 30


def _stuck(bit: int, part: str, reaction: int) -> Row:
    """Row of an actuator that does not follow its command."""
    says = f'the {part} does not follow its command'
    return Row(bit, f'{part.replace(" ", "_")}_stuck', says, reaction)


#: Every row, in the order in which they are reported.
ROWS = (
    _stuck(STUCK_BUOYANCY, 'buoyancy engine', SURFACE),
    _stuck(STUCK_PITCH, 'pitch mass', SURFACE),
    _stuck(STUCK_ROLL, 'roll mass', HOLD),
    _stuck(STUCK_SURFACE, 'steering surface', HOLD),
    Row(ORDERED, 'surface_ordered', 'ordered to the surface'),
    Row(TOO_DEEP, 'too_deep', 'deeper than the vehicle is rated for'),
    Row(CRUSHING, 'crush_depth', 'deeper than its hull may bear, or about to be', DROP),
    Row(NEAR_BOTTOM, 'near_bottom', 'too close to the bottom'),
    Row(OVERDEPTH, 'overdepth', 'deeper than it was sent'),
    Row(NOT_CLIMBING, 'not_climbing', 'does not climb'),
    Row(NOT_RISING, 'not_rising', 'does not rise though all is done for it', DROP),
    Row(
        TOO_HEAVY,
        'too_heavy',
        'heavier than its pump says: water in the hull, growth, or a wing that is lost',
    ),
    Row(STALLED, 'stalled', 'stays at one depth'),
    Row(UNDER_LONG, 'under_too_long', 'has been under water for too long'),
    Row(
        FROZEN,
        'measurement_frozen',
        'the measured depth stands still, or goes elsewhere than pump and pitch lead, or the '
        'vehicle lies aground or on denser water',
    ),
    Row(DEPTH_OFFSET, 'depth_offset', 'the depth is not 0 at the surface, and is corrected', NOTE),
    Row(DEPTH_WRONG, 'depth_wrong', 'the measured depth is wrong at the surface, or has jumped'),
    Row(DISAGREES, 'depth_disagrees', 'pressure and odom tell different depths'),
    Row(CONTRADICTED, 'fixes_contradict', 'a fix contradicts navigation', NOTE),
    Row(
        ASTRAY,
        'astray',
        'fixes contradict navigation again and again: a compass or its declination is wrong',
    ),
    Row(LOST, 'measurement_lost', 'nothing usable is measured'),
    Row(NO_DEMAND, 'demand_lost', 'control demands nothing usable'),
    Row(LEAK, 'leak', 'there is water in the hull'),
    Row(VACUUM, 'vacuum', 'the vacuum in the hull is not what it should be'),
    Row(BATTERY, 'battery', 'the battery is low'),
    Row(NO_CONTACT, 'no_contact', 'nobody has heard of it for too long'),
)


@kernel
def row(bit, holds):
    """What is reported of a row: its bit, if it holds."""
    return bit if holds else 0


HOLDS, SURFACES, DROPS = (
    sum(row.bit for row in ROWS if row.reaction == one) for one in (HOLD, SURFACE, DROP)
)
#: While one of these holds the depth is not trusted.
BLIND = FROZEN | LOST | DISAGREES | DEPTH_WRONG
LATCHED = sum(row.bit for row in ROWS if row.latches)
ALL = sum(row.bit for row in ROWS)


def reaction_of(reported: int) -> int:
    """The gravest reaction to some rows."""
    return max((row.reaction for row in ROWS if reported & row.bit), default=NONE)


def say(reported: int) -> str:
    """What some rows say, in words; empty if they say nothing."""
    said = '; '.join(row.says for row in ROWS if reported & row.bit)
    reaction = reaction_of(reported)
    return f'{REACTIONS[reaction]}: {said}' if reaction > NOTE else said
