# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""How far off the plant came out, and the models of others over the same samples.

Those are gliderflight, and that of the base station of a Seaglider.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import cumulative_trapezoid

from glider_base.errors import ConfigurationError, installed
from glider_flights.navigation import navigate
from glider_flights.record import Flight, Segment, at_times, vertical_rate
from glider_flights.validation.flying import RATE_S, Model, Simulated, Track

#: Heading turns over this time (s), so that noise of the compass is small beside a turn.
TURN_S = 60.0
#: Turn rates are given for this speed through the water (m/s).
TURN_MPS = 0.5
#: What turns a vehicle: the angle, and with which power of the speed its turn rate grows.
STEERED_BY = {
    'turn_rate_per_sin_roll': ('roll_rad', 1.0),
    'turn_rate_per_sin_fin': ('surface_rad', 2.0),
}
#: An angle whose sine does not vary by as much (-, standard deviation) tells nothing of turns.
SMALLEST_ANGLE = 0.02
#: A dive counts as flown if this share of its time was.
WHOLE = 0.8
PHASES = {'dive': 1.0, 'climb': -1.0}


#: A stretch that was recorded, and what the plant did along it.
Pair = tuple[Track, Simulated]


class Adcp(NamedTuple):
    """Speed through the water (m/s) that was measured, and when (s since 1970), of shape (n,)."""

    time_s: np.ndarray
    speed_mps: np.ndarray


def score(flight: Flight, pairs: list[Pair], model: Model, speed: np.ndarray) -> dict[str, Any]:
    """Figures of a flight, as ``model``, which knows the true pitch, flew it.

    ``speed``, float64[n], is the simulated one less that by an ADCP (m/s); none without one.
    """
    rate = rate_off(pairs)
    pitch = np.concatenate(
        [
            (one.pitch_rad - model.pitch(track.instruments.pitch_rad))[track.counts]
            for track, one in pairs
        ]
    )
    return {
        'segments': len(pairs),
        'samples': len(rate),
        'w_rmse_cmps': rms(rate, 100.0),
        'w_bias_cmps': figure(rate, 100.0),
        'u_adcp_rmse_cmps': rms(speed, 100.0),
        'u_adcp_bias_cmps': figure(speed, 100.0),
        'pitch_rmse_deg': rms(pitch, math.degrees(1.0)),
        **turn_rates(pairs),
        'dac_off_cmps': _closure(flight, pairs),
    }


def rate_off(pairs: list[Pair]) -> np.ndarray:
    """Vertical rate flown less that recorded (m/s), of the samples that are compared."""
    return np.concatenate([(one.rate_mps - track.rate_mps)[track.counts] for track, one in pairs])


def turn_rates(pairs: list[Pair]) -> dict[str, Any]:
    """Turn rates over the sine of roll and fin at `TURN_MPS` (rad/s), by phase."""
    return {
        turns: {
            name: {
                'recorded': _turn_rate(pairs, phase, angle, power, recorded=True),
                'simulated': _turn_rate(pairs, phase, angle, power, recorded=False),
            }
            for name, phase in PHASES.items()
        }
        for turns, (angle, power) in STEERED_BY.items()
    }


def figure(
    values: np.ndarray, scale: float, of: Callable[[np.ndarray], float] = np.mean
) -> float | None:
    """A mean, or another figure, of what is known; None if nothing is."""
    values = values[np.isfinite(values)]
    return round(scale * float(of(values)), 4) if len(values) else None


def rms(values: np.ndarray, scale: float) -> float | None:
    """Root mean square of what is known; None if nothing is."""
    return figure(values, scale, lambda known: np.sqrt(np.mean(known**2)))


def speed_off(track: Track, flown: Simulated, adcp: Adcp) -> np.ndarray:
    """Simulated less measured speed (m/s) of the samples in the dive, as an ADCP looks ahead."""
    return flown.speed_mps[track.counts & (track.phase > 0.0)] - measured(track, adcp)


def measured(track: Track, adcp: Adcp) -> np.ndarray:
    """Speed by an ADCP (m/s) of the samples in the dive; NaN where there is none."""
    speed = at_times(track.instruments.time_s, adcp.time_s, adcp.speed_mps)
    return speed[track.counts & (track.phase > 0.0)]


def _turn_rate(pairs, phase: float, by: str, power: float, recorded: bool) -> float | None:
    """Turn rate over an angle's sine at `TURN_MPS` (rad/s), by least squares with an offset."""
    rows, rates = [], []
    for track, one in pairs:
        time_s = track.instruments.time_s
        flown = track.instruments if recorded else one
        heading = flown.heading_rad
        # the fin is where it was recorded, also of the plant
        angle = getattr(flown if by in flown._fields else track.instruments, by)
        good = np.isfinite(heading) & np.isfinite(angle)
        if good.sum() < 3:
            continue
        heading = np.interp(time_s, time_s[good], np.unwrap(heading[good]))
        sine = np.interp(time_s, time_s[good], np.sin(angle[good]))
        begin, end = time_s - 0.5 * TURN_S, time_s + 0.5 * TURN_S
        inside = (begin >= time_s[0]) & (end <= time_s[-1]) & track.counts
        counts = inside & (track.phase == phase)
        turned = np.interp(end, time_s, heading) - np.interp(begin, time_s, heading)
        asked = sine * (one.speed_mps / TURN_MPS) ** power
        asked = cumulative_trapezoid(asked, time_s, initial=0.0)
        share = (np.interp(end, time_s, asked) - np.interp(begin, time_s, asked)) / TURN_S
        rows.append(share[counts])
        rates.append((turned / TURN_S)[counts])
    asked = np.concatenate(rows or [np.empty(0)])
    if len(asked) < 3 or np.std(asked) * TURN_MPS / 0.3 < SMALLEST_ANGLE:
        return None
    return round(float(np.polyfit(asked, np.concatenate(rates), 1)[0]), 4)


def _closure(flight: Flight, pairs) -> dict[str, Any]:
    """Our depth-averaged current, by the plant's way through the water, less that on board."""
    off = []
    for row in navigate(flight, lambda *_: None):
        way, seconds = _way(row.segment, pairs)
        if seconds > WHOLE * row.seconds:
            own = row._replace(way_m=way).comparable_mps
            off.append(float(np.hypot(*(own - row.segment.on_board.dac_mps))))
    off = np.array(off, float)
    return {'median': figure(off, 100.0, np.median), 'segments': int(np.isfinite(off).sum())}


def _way(segment: Segment, pairs) -> tuple[np.ndarray, float]:
    """Way through the water of a segment (m north, east), and for how long it was flown (s)."""
    way, seconds = np.zeros(2), 0.0
    for track, one in pairs:
        time_s, heading = track.instruments.time_s, track.instruments.heading_rad
        middle_s = 0.5 * (time_s[0] + time_s[-1])
        if not segment.before.time_s[-1] <= middle_s <= segment.after.time_s[0]:
            continue
        ahead, abeam = np.diff(one.ahead_m), np.diff(one.abeam_m)
        middle = np.unwrap(heading)
        middle = 0.5 * (middle[1:] + middle[:-1])
        north = ahead * np.cos(middle) - abeam * np.sin(middle)
        east = ahead * np.sin(middle) + abeam * np.cos(middle)
        way += np.array([np.nansum(north), np.nansum(east)])
        seconds += float(np.ptp(time_s))
    return way, seconds


# ---- models of others

#: As the documentation of gliderflight has it: lift slope of the hull (1/rad), induced drag
#: (1/rad^2), and the parasitic drag that its fit begins with.
LIFT, INDUCED, DRAG = 3.8, 10.5, 0.15
#: What it calls those of our constants that it can fit too.
THEIRS = {'mass': 'mg', 'Cd0': 'Cd0', 'Cd1': 'Cd1', 'lift': 'ah', 'compressibility': 'epsilon'}
CC_PER_M3, BAR_PER_DBAR = 1e6, 0.1


def peer(
    fitting: list[Track], tried: list[Track], model: Model, names: tuple[str, ...]
) -> tuple[dict[str, Any] | None, str]:
    """Figures of the other model of this kind of vehicle, or None and why.

    Its constants are fitted to some stretches, those that stand for ``names`` of ours, and
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
    if any(np.isnan(track.density_kgpm3).all() for track in [*fitting, *tried]):
        return None, 'gliderflight needs temperature and salinity, which were not recorded'
    fits = [THEIRS[name] for name in names if name in THEIRS] if fitting else []
    rates = _gliderflight(gliderflight, fitting, tried, model, fits)
    return {**_figures('gliderflight', tried, rates), 'fitted': fits}, ''


def _figures(name: str, found: list[Track], rates: list[np.ndarray]) -> dict[str, Any]:
    off = np.concatenate(
        [(rate - track.rate_mps)[track.counts] for track, rate in zip(found, rates, strict=True)]
    )
    return {'name': name, 'w_rmse_cmps': rms(off, 100.0), 'samples': int(np.isfinite(off).sum())}


def _gliderflight(
    gliderflight, fitting: list[Track], tried: list[Track], model: Model, fits: list[str]
) -> list[np.ndarray]:
    """Vertical rates (m/s, + down) of Merckelbach's steady model, fitted.

    Unfitted it weighs what our file says; a fit begins with the weight of the water.
    """
    rho_0 = float(np.nanmean(np.concatenate([track.density_kgpm3 for track in fitting or tried])))
    theirs = gliderflight.SteadyStateCalibrate(rho0=rho_0)
    vehicle = model.vehicle
    weight = rho_0 * vehicle.volume if fits else vehicle.m + vehicle.ballast
    theirs.define(ah=LIFT, Cd1=INDUCED, Cd0=DRAG, mg=weight, Vg=vehicle.volume)
    if fits:
        theirs.set_input_data(**_inputs(fitting, model))
        theirs.set_mask(~np.concatenate([track.counts for track in fitting]))
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
