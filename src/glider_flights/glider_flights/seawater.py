# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Sea water of recorded flights: depth, salinity and density by TEOS-10 (gsw)."""

import numpy as np

from glider_model.base.errors import ConfigurationError


def _gsw():
    """The library, or one sentence on how to get it."""
    try:
        import gsw
    except ImportError:
        raise ConfigurationError(
            'gsw, which knows sea water, is not installed; install it with: '
            './glider python -m pip install --no-deps -r requirements-flights.txt'
        ) from None
    return gsw


def depth_of(pressure_dbar: np.ndarray, latitude_deg: float) -> np.ndarray:
    """Depth (m) of a pressure above that of the air (dbar)."""
    gsw = _gsw()
    return -gsw.z_from_p(pressure_dbar, latitude_deg)


def pressure_of(depth_m: np.ndarray, latitude_deg: float) -> np.ndarray:
    """Pressure above that of the air (dbar) at a depth (m)."""
    gsw = _gsw()
    return gsw.p_from_z(-depth_m, latitude_deg)


def salinity_of(
    conductivity_mspcm: np.ndarray, temperature_degc: np.ndarray, pressure_dbar: np.ndarray
) -> np.ndarray:
    """Practical salinity of a conductivity (mS/cm)."""
    gsw = _gsw()
    return gsw.SP_from_C(conductivity_mspcm, temperature_degc, pressure_dbar)


def density_of(
    salinity: np.ndarray,
    temperature_degc: np.ndarray,
    pressure_dbar: np.ndarray,
    origin_deg: np.ndarray,
) -> np.ndarray:
    """Density in situ (kg/m^3) of practical salinity at a latitude and longitude (degrees)."""
    gsw = _gsw()
    latitude, longitude = origin_deg
    absolute = gsw.SA_from_SP(salinity, pressure_dbar, longitude, latitude)
    return gsw.rho_t_exact(absolute, temperature_degc, pressure_dbar)
