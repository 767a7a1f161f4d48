# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The forecast by which a route is planned: not what the vehicle will meet."""

import pydantic
from pydantic import Field

from glider_base.settings import Settings, beside


class RouteForecast(Settings):
    """A forecast of the current for who plans the route: a file, or the truth with an error."""

    file: str = Field(
        '',
        max_length=4000,
        description='NetCDF file, relative to this one; without: the current of the scenario',
    )
    error_mps: float = Field(
        0.0,
        ge=0.0,
        le=1.0,
        description='rms of a random error of each part of the depth-averaged current (m/s)',
    )
    error_km: float = Field(
        40.0, ge=5.0, le=1000.0, description='correlation length of the error (km)'
    )
    late_h: float = Field(
        0.0, ge=0.0, le=240.0, description='by what its water comes too late: its age (h)'
    )

    _found = pydantic.field_validator('file')(beside)
