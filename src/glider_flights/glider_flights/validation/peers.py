# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Flight models of others over the same samples: gliderflight, and that of a base station."""

from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

from glider_base.errors import ConfigurationError
from glider_flights.folders import installed
from glider_flights.record import vertical_rate
from glider_flights.validation.flying import Model
from glider_flights.validation.score import rms
from glider_flights.validation.track import RATE_S, Track

#: As the documentation of gliderflight has it: lift slope of the hull (1/rad), induced drag
#: (1/rad^2), and the parasitic drag that its fit begins with.
LIFT, INDUCED, DRAG = 3.8, 10.5, 0.15
#: What it calls those of our constants that it can fit too.
THEIRS = {'mass': 'mg', 'Cd0': 'Cd0', 'Cd1': 'Cd1', 'lift': 'ah', 'compressibility': 'epsilon'}
CC_PER_M3, BAR_PER_DBAR = 1e6, 0.1


def peer(
    told: list[Track], tried: list[Track], model: Model, names: tuple[str, ...]
) -> tuple[dict[str, Any] | None, str]:
    """Figures of the other model of this kind of vehicle, or None and why.

    Its constants are fitted to the stretches ``told``, those that stand for ``names`` of ours, and
    it is tried on others. What a base station wrote is as it is: it has fitted it to all.
    """
    own = [track.instruments.own_rate_mps for track in tried]
    if any(np.isfinite(rate).any() for rate in own):
        return _figures('basestation', tried, own), ''
    try:
        with installed('gliderflight, the model to compare with'):
            import gliderflight
    except ConfigurationError as error:
        return None, str(error)
    if any(np.isnan(track.density_kgpm3).all() for track in [*told, *tried]):
        return None, 'gliderflight needs temperature and salinity, which were not recorded'
    fits = [THEIRS[name] for name in names if name in THEIRS] if told else []
    rates = _gliderflight(gliderflight, told, tried, model, fits)
    return {**_figures('gliderflight', tried, rates), 'fitted': fits}, ''


def _figures(name: str, found: list[Track], rates: list[np.ndarray]) -> dict[str, Any]:
    off = np.concatenate(
        [(rate - track.rate_mps)[track.counts] for track, rate in zip(found, rates, strict=True)]
    )
    return {
        'name': name,
        'w_rmse_cmps': rms(off, 100.0),
        'samples': int(np.isfinite(off).sum()),
    }


def _gliderflight(
    gliderflight, told: list[Track], tried: list[Track], model: Model, fits: list[str]
) -> list[np.ndarray]:
    """Vertical rates (m/s, + down) of Merckelbach's steady model, fitted to what it is told.

    Unfitted it weighs what our file says; a fit begins with the weight of the water.
    """
    rho_0 = float(np.nanmean(np.concatenate([track.density_kgpm3 for track in told or tried])))
    theirs = gliderflight.SteadyStateCalibrate(rho0=rho_0)
    vehicle = model.vehicle
    weight = rho_0 * vehicle.volume if fits else vehicle.m + vehicle.ballast
    theirs.define(ah=LIFT, Cd1=INDUCED, Cd0=DRAG, mg=weight, Vg=vehicle.volume)
    if fits:
        theirs.set_input_data(**_inputs(told, model))
        theirs.set_mask(~np.concatenate([track.counts for track in told]))
        theirs.calibrate(*fits)
    theirs.set_input_data(**_inputs(tried, model))
    theirs.set_mask(~np.concatenate([track.counts for track in tried]))
    theirs.solve()
    rates = []
    ends = np.cumsum([len(track.phase) for track in tried])[:-1]
    for track, rising in zip(tried, np.split(theirs.wg, ends), strict=True):
        time_s = track.instruments.time_s
        risen_m = cumulative_trapezoid(rising, time_s, initial=0.0)
        rates.append(vertical_rate(time_s, -risen_m, RATE_S))
    return rates


def _inputs(found: list[Track], model: Model) -> dict[str, np.ndarray]:
    """What gliderflight goes by, in its units, and the recorded rate as we have it."""
    parts = [
        {
            'time': track.instruments.time_s,
            'pressure': BAR_PER_DBAR * track.pressure_dbar,
            'pitch': model.pitch(track.instruments.pitch_rad),
            'buoyancy_change': CC_PER_M3 * track.instruments.pumped_m3,
            'density': track.density_kgpm3,
            'dhdt': -track.rate_mps,
        }
        for track in found
    ]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
