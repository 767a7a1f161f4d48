# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A forecast of the current, as a vehicle takes it along on its mission.

It is said in the words of the current of a scenario. What fixes tell is by how much it is off.
"""

from typing import NamedTuple

import numpy as np
import pydantic
from pydantic import Field

from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Vector
from glider_model.ocean.current import (
    CurrentParams,
    CurrentState,
    current_step_in_place,
)
from glider_model.ocean.current_settings import SumOfCurrents


class ForecastSettings(SumOfCurrents):
    """Current that was forecast, and how far its mean over a way may be off."""

    error_std_mps: float = Field(
        0.1,
        gt=0.0,
        le=1.0,
        description='standard deviation of the forecast, of its north and of its east part (m/s)',
    )

    @pydantic.model_validator(mode='after')
    def _check_forecast(self):
        for number, component in enumerate(self.components):
            if component.kind == 'gauss_markov':
                raise ValueError(
                    f"components.{number}.kind = 'gauss_markov': nobody forecasts what is random"
                )
        return self

    @property
    def is_given(self) -> bool:
        """Whether there is anything in it."""
        return self._has_flow() or bool(self.components) or self.field is not None


class Forecast(NamedTuple):
    """A forecast as the kernels see it; nothing in it is a forecast of still water."""

    is_believed: bool
    params: CurrentParams
    nothing: CurrentState  #: no part of it remembers anything


def make_forecast(settings: ForecastSettings, is_believed: bool) -> Forecast:
    """Forecast of some settings, or of none."""
    params = (settings if is_believed else ForecastSettings()).params()
    return Forecast(is_believed, params, CurrentState(0, np.zeros(0)))


@kernel
def forecast_at(forecast, place, depth, t_s):
    """Current (m/s) that is forecast for a place (m), depth (m) and time since the start (s)."""
    if not forecast.is_believed:
        return Vector(0.0, 0.0)
    position = (place.n, place.e, depth)
    _, water = current_step_in_place(forecast.nothing, position, t_s, forecast.params, TICK_S)
    return Vector(water.v_n, water.v_e)
