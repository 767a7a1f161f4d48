# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Faults drawn at random, of what `random_faults.yaml` says."""

import itertools
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pydantic

from glider_base.files import read_yaml
from glider_model.plant.faults.settings import PHASES, SENSED, Fault, FaultSettings

_FILE = read_yaml(Path(__file__).with_suffix('.yaml'))
#: Fields of what is drawn, by kind.
DRAWN: dict[str, dict[str, Any]] = _FILE['kinds']
#: Shares of them that wait for a phase, and for a depth.
BY_PHASE, BY_DEPTH = 0.25, 0.25
#: Sets the draw apart from that of the plant of the same seed.
_STREAM = 13
_FAULT = pydantic.TypeAdapter(Fault)


def sample_faults(
    seed: int,
    count: int,
    duration_s: float,
    steered: bool = False,
    depth_m: float = 0.0,
    shows: Collection[str] = tuple(SENSED),
) -> list[dict[str, Any]]:
    """Draw faults that begin within ``duration_s``: fields of a scenario, as one would type them.

    Where the vehicle is ``steered`` by a surface, that may break too. Some begin somewhere in its
    dives to ``depth_m``; 0.0: by time alone. None is of something that no sensor ``shows``.
    """
    draw = np.random.Generator(np.random.PCG64([seed, _STREAM]))
    drawn = (_sample(draw, duration_s, steered, depth_m) for _ in itertools.count())
    fitted = (one for one in drawn if validated([one])[0].measures in ('', *shows))
    return list(itertools.islice(fitted, count))


def _draw(draw: np.random.Generator, of: Any, largest: float = 1.0) -> Any:
    """A value as one would type it; ``largest`` is the largest size that goes without saying."""
    if 'one_of' in of:
        return draw.choice(of['one_of']).item()
    if 'decades' in of:
        least, most = of['decades']
        number = least * (most / least) ** draw.random()
    elif 'up_to' in of:
        number = (of['up_to'] or largest) * 10.0 ** -draw.uniform(0.0, 3.0)
        number *= 1.0 if draw.random() < 0.5 else -1.0
    else:
        number = draw.uniform(*of)
    return float(f'{number:.4g}')


def _sample(
    draw: np.random.Generator, duration_s: float, steered: bool, depth_m: float
) -> dict[str, Any]:
    kind = str(draw.choice(sorted(DRAWN)))
    fields: dict[str, Any] = {'kind': kind}
    for name, of in DRAWN[kind].items():
        if name == 'actuator' and steered:
            of = {'one_of': [*of['one_of'], 'steering_surface']}
        fields[name] = _draw(draw, of, _FILE['errors'].get(fields.get('sensor'), 1.0))
    fields['at_s'] = round(draw.uniform(*_FILE['begins']) * duration_s, 1)
    when = draw.random()
    if depth_m and when < BY_PHASE + BY_DEPTH:
        fields['phase'] = str(draw.choice(PHASES[1:]))
        if when < BY_DEPTH and fields['phase'] in ('dive', 'climb'):
            fields['at_depth_m'] = round(draw.uniform(0.0, 1.0) * depth_m, 1)
    if draw.random() < 0.5:
        fields['for_s'] = round(_draw(draw, _FILE['lasts_s']), 1)
    return fields


def validated(fields: Iterable[dict[str, Any]]) -> list[FaultSettings]:
    """Faults of drawn fields."""
    return [_FAULT.validate_python(one) for one in fields]
