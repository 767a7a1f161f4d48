# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Sea water of recorded flights: depth, salinity and density by TEOS-10 (gsw)."""

import numpy as np

from glider_flights.folders import installed


def _gsw():
    """The library."""
    with installed('gsw, which knows sea water'):
        import gsw
    return gsw


def depth_of(pressure_dbar: np.ndarray, latitude_deg: float) -> np.ndarray:
    """Depth (m) of a pressure above that of the air (dbar)."""
    return -_gsw().z_from_p(pressure_dbar, latitude_deg)


def pressure_of(depth_m: np.ndarray, latitude_deg: float) -> np.ndarray:
    """Pressure above that of the air (dbar) at a depth (m)."""
    return _gsw().p_from_z(-depth_m, latitude_deg)


def salinity_of(
    conductivity_mspcm: np.ndarray, temperature_degc: np.ndarray, pressure_dbar: np.ndarray
) -> np.ndarray:
    """Practical salinity of a conductivity (mS/cm)."""
    return _gsw().SP_from_C(conductivity_mspcm, temperature_degc, pressure_dbar)


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
