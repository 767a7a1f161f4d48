# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A forecast of the current, as a vehicle takes it along on its mission.

It is said in the words of the current of a scenario, and taken by its mean over the depth of the
dives. Who steers by that does not turn against the water of every depth, which costs way in a
shear: the mean of sqrt(U^2 - v^2) is less than that of the mean of v. Fixes tell two things of it:
by how much it is off, and what share of it there is in the sea. The second is learnt from how the
current changed from one way to the next, beside how that was forecast (recursive least squares): a
forecast of eddies that are not there comes to be left out, and the last mean holds, as without a
forecast.
"""

from typing import NamedTuple

import numpy as np
import pydantic

from glider_base.kernel import kernel
from glider_base.settings import number, positive
from glider_base.signals import TICK_S, Vector
from glider_model.ocean.current import CurrentParams, current_in_place
from glider_model.ocean.current_settings import SumOfCurrents
from glider_model.ocean.field import Mission

#: Levels of a mean over depth.
_LEVELS = 5
#: No more of a forecast is used than this share.
MOST_SHARE = 1.5


class ForecastSettings(SumOfCurrents):
    """Current that was forecast, and how far its mean over a way may be off."""

    error_std_mps: float = positive(
        0.1, 1.0, 'standard deviation of the forecast, of its north and of its east part (m/s)'
    )
    share_std: float = number(
        1.0,
        (0.0, 2.0),
        'how far the share of the forecast that there is in the sea may be off 1, at first (-); '
        '0.0: it is taken whole, whatever fixes tell',
    )
    late_h: float = number(0.0, (0.0, 240.0), 'by what its water comes too late: its age (h)')

    @pydantic.model_validator(mode='after')
    def _check_forecast(self):
        for i, component in enumerate(self.components):
            if component.kind == 'gauss_markov':
                raise ValueError(
                    f"components.{i}.kind = 'gauss_markov': nobody forecasts what is random"
                )
        return self

    def resolved(self, course_rad: float, mission: Mission | None = None) -> 'ForecastSettings':
        """As that of a current; what is late is asked for from before the mission on."""
        if mission:
            mission = mission.model_copy(update={'earlier_s': 3600.0 * self.late_h})
        return super().resolved(course_rad, mission)

    @property
    def is_given(self) -> bool:
        """Whether there is anything in it."""
        return self._has_flow() or bool(self.components) or self.field is not None


class Forecast(NamedTuple):
    """A forecast as the kernels see it; nothing in it is a forecast of still water."""

    is_used: bool
    params: CurrentParams
    nothing: np.ndarray  #: values that its parts remember: none
    late_s: float = 0.0  #: age (s)


class Trust(NamedTuple):
    """What share of a forecast is used."""

    share: float
    variance: float  #: of it


def make_forecast(settings: ForecastSettings, is_used: bool) -> Forecast:
    """Forecast of some settings, or of none."""
    params = (settings if is_used else ForecastSettings()).params()
    return Forecast(is_used, params, np.zeros(0), 3600.0 * settings.late_h)


@kernel
def forecast_at(forecast, place, depth, deepest, t_s):
    """Current (m/s) that is forecast for a place (m) and time since the start (s).

    The mean from the surface to ``deepest`` (m); if that is 0.0, that at the ``depth`` (m).
    """
    v_n, v_e = 0.0, 0.0
    levels = _LEVELS if deepest > 0.0 else 1
    for k in range(levels if forecast.is_used else 0):
        at = depth if levels == 1 else (k + 0.5) / levels * deepest
        position, then_s = (place.n, place.e, at), t_s - forecast.late_s
        water = current_in_place(0, forecast.nothing, position, then_s, forecast.params, TICK_S)
        v_n += water.v_n / levels
        v_e += water.v_e / levels
    return Vector(v_n, v_e)


@kernel
def weigh(trust, off, change, variance):
    """What share of a forecast is used after a way; ``trust`` is that before it.

    ``off`` is the mean current over the way less its estimate (m/s), and ``variance`` that of
    its north and of its east part, were the share known (m^2/s^2). ``change`` is the mean of the
    forecast over the way less that of the way before (m/s).
    """
    gain = trust.variance / (variance + trust.variance * squared(change))
    share = trust.share + gain * (change.n * off.n + change.e * off.e)
    return Trust(min(MOST_SHARE, max(0.0, share)), trust.variance * (1.0 - gain * squared(change)))


@kernel
def squared(v):
    """Square of the length of a vector."""
    return v.n * v.n + v.e * v.e
