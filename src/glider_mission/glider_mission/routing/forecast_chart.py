# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Charts of depth-averaged current: of a forecast, with errors, and with what was observed."""

import math
from typing import NamedTuple

import numpy as np

from glider_base.errors import ConfigurationError
from glider_base.frames import from_geodetic
from glider_base.kernel import kernel
from glider_base.linear import solve
from glider_base.noise import random_stream
from glider_base.signals import TICK_S, raised
from glider_base.slot import NOT_COMPILED
from glider_mission.routing.fronts import Chart, current_on
from glider_mission.scenario import Scenario, check_starts, named_in
from glider_model.ocean.bottom import bottom_depth
from glider_model.ocean.current import CurrentParams, current_in_place
from glider_model.ocean.current_settings import CurrentSettings
from glider_model.ocean.fields.grid import GridSettings

#: Step of the lattice (m) at least, of time (s), levels of a mean over depth, margin (m).
STEP_M, STEP_S, _LEVELS, MARGIN_M = 3000.0, 3.0 * 3600.0, 10, 60_000.0
#: Points along either side of a chart at most.
_MOST = 160
#: Errors of a forecast last about so long (s); what is left of one that was observed (m/s).
_ERROR_S, OBSERVED_STD = 4.0 * 86_400.0, 0.02


@kernel
def _depth_means(params, nothing, times, norths, easts, depths, found):
    """Fill ``found`` with means of the current over depths."""
    for t in range(len(times)):
        for i in range(len(norths)):
            for j in range(len(easts)):
                v_n, v_e = 0.0, 0.0
                for depth in depths:
                    place = (norths[i], easts[j], depth)
                    water = current_in_place(0, nothing, place, times[t], params, TICK_S)
                    v_n += water.v_n
                    v_e += water.v_e
                found[t, i, j, 0] = v_n / len(depths)
                found[t, i, j, 1] = v_e / len(depths)


def _lattice(scenario: Scenario, params: CurrentParams) -> tuple[np.ndarray, np.ndarray]:
    """North and east of the points of a chart around a mission (m), within its grid if any."""
    corners = scenario.path.points(0)[:, :2]
    start = (scenario.initial.north_m, scenario.initial.east_m)
    places = np.vstack((corners, start))
    low, high = places.min(axis=0) - MARGIN_M, places.max(axis=0) + MARGIN_M
    field, origin = params.field, scenario.origin.params()
    if hasattr(field, 'latitudes'):
        edges = ((field.latitudes[k], field.longitudes[k]) for k in (0, -1))
        low, high = (
            limit(one, from_geodetic(*edge, origin))
            for limit, one, edge in zip((np.maximum, np.minimum), (low, high), edges, strict=True)
        )
    step = max(STEP_M, float((high - low).max()) / _MOST)
    high = np.maximum(high, low + step)  # beyond a narrow grid is the water of its edge
    return tuple(np.arange(a, b + 1e-6, step) for a, b in zip(low, high, strict=True))


class Forecast(NamedTuple):
    """What a route is planned by."""

    chart: Chart  #: of dives, as is observed
    stays: np.ndarray  #: what surface intervals add to it, float32[t, n, m, 2] (m/s)
    land: np.ndarray  #: where it is, bool[n, m]
    error_mps: float  #: that the current may have, rms of each part

    def sailed(self, chart: Chart) -> Chart:
        """What is sailed in, dives and stays, where that of dives is such a chart."""
        return chart._replace(current=chart.current + self.stays)


def forecast_of(scenario: Scenario, stay: float) -> Forecast:
    """The forecast of a mission, as it is to be expected by its error.

    For the share ``stay`` of the time the vehicle is at the surface. Raises ConfigurationError if
    the file of the forecast cannot be read, or does not cover the mission.
    """
    forecast, current = scenario.forecast, scenario.current
    if forecast.file:
        current = CurrentSettings(field=GridSettings(file=forecast.file))
    steady = [one for one in current.components if one.kind != 'gauss_markov']
    settings = scenario.resolved_current(current.model_copy(update={'components': steady}))
    late_s, grid = 3600.0 * forecast.late_h, settings.field
    if isinstance(grid, GridSettings):
        grid = grid.resolved(grid.mission.model_copy(update={'earlier_s': late_s}))
        settings = settings.model_copy(update={'field': grid})
    with named_in('forecast: ', ValueError):
        params = settings.params(0)
    true = scenario.resolved_current(scenario.current).field
    if isinstance(grid, GridSettings) and isinstance(true, GridSettings):
        check_starts({'current.field.file': true.start_s, 'forecast.file': grid.start_s})
    norths, easts = _lattice(scenario, params)
    times = np.arange(0.0, scenario.duration_s + STEP_S, STEP_S)
    depths = (np.arange(_LEVELS) + 0.5) * scenario.profile.depth_m / _LEVELS
    means, at_top = np.empty((2, len(times), len(norths), len(easts), 2), dtype=np.float32)
    nothing = np.zeros(0)
    for levels, found in ((depths, means), (np.zeros(1), at_top)):
        try:
            _depth_means(params, nothing, times - late_s, norths, easts, levels, found)
        except (ConfigurationError, *NOT_COMPILED):
            raise
        except Exception as error:  # of a field of somebody's own
            raise ConfigurationError(f'current.field: {raised(error)}') from error
        if not np.isfinite(found).all():
            t, i, j, k = np.argwhere(~np.isfinite(found))[0]
            raise ConfigurationError(
                f'current.field: {found[t, i, j, k]} m/s after {times[t]:,.0f} s at north '
                f'{norths[i]:,.0f} m, east {easts[j]:,.0f} m (allowed: numbers)'
            )
    stays = stay * (at_top + np.float32(scenario.water.wind_drift()) - means)
    chart = Chart(times, norths, easts, means)
    land = np.zeros(means.shape[1:3], dtype=bool)
    if isinstance(grid, GridSettings):
        land = grid.land_at(norths, easts)
    if scenario.bathymetry.file:
        bottom = scenario.bottom()
        land |= np.array([[bottom_depth(n, e, bottom) <= 0.0 for e in easts] for n in norths])
    error_mps = forecast.error_mps
    if error_mps > 0.0:
        if not forecast.file:  # which errs by itself
            chart = erroneous(chart, error_mps, forecast.error_km, scenario.seed, 0)
        chart, error_mps = expected(chart, error_mps)
    return Forecast(chart, stays, land, error_mps)


def expected(chart: Chart, error_mps: float) -> tuple[Chart, float]:
    """What is to be expected where a chart errs by so much, and by how much that errs (m/s).

    The chart is as far from its mean as eddies and errors together; eddies are what is left of
    its variance (Wiener's filter, by the whole of the chart).
    """
    mean = chart.current.mean(axis=(0, 1, 2))
    away = chart.current - mean
    share = 1.0 - error_mps**2 / max(float(np.mean(away**2)), error_mps**2)
    current = (mean + share * away).astype(np.float32)
    return chart._replace(current=current), error_mps * math.sqrt(share)


def erroneous(chart: Chart, error_mps: float, error_km: float, seed: int, member: int) -> Chart:
    """A chart with a random error of its own, by seed and member: eddies that are not there.

    It has an rms of each part of ``error_mps``, and a correlation length of ``error_km``.
    """
    from scipy.ndimage import gaussian_filter

    rng = np.random.default_rng(int(random_stream(seed, member, 0)))
    step = chart.norths[1] - chart.norths[0]
    widths = _ERROR_S / STEP_S, *(2 * (1e3 * error_km / step,))
    beyond = [math.ceil(2.0 * width) for width in widths]
    shape = [len(one) + 2 * more for one, more in zip(chart[:3], beyond, strict=True)]
    stream = gaussian_filter(rng.standard_normal(shape), widths, mode='wrap', truncate=3.0)
    inside = tuple(slice(more, -more) for more in beyond)
    east, north = -np.gradient(stream, axis=1)[inside], np.gradient(stream, axis=2)[inside]
    scale = error_mps / math.sqrt(0.5 * float(np.mean(east**2 + north**2)))
    error = scale * np.stack((north, east), axis=-1)
    return chart._replace(current=(chart.current + error).astype(np.float32))


@kernel
def _alike(t_s, n, e, one, length):
    """How far errors at a time (s) and place (m) are those at an observation, 1 at its own."""
    away2 = (n - one[1]) ** 2 + (e - one[2]) ** 2
    return math.exp(-away2 / (2.0 * length**2) - abs(t_s - one[0]) / _ERROR_S)


@kernel
def _alike_each_other(seen, length):
    """`_alike` of observations, float64[n, n]."""
    found = np.empty((len(seen), len(seen)))
    for i in range(len(seen)):
        for j in range(len(seen)):
            found[i, j] = _alike(seen[i, 0], seen[i, 1], seen[i, 2], seen[j], length)
    return found


@kernel
def _correct(current, times, norths, easts, seen, weights, length):
    """Add to a current what observations tell of it, by their weights, float64[n, 2] (m/s)."""
    for t in range(len(times)):
        for i in range(len(norths)):
            for j in range(len(easts)):
                v_n, v_e = 0.0, 0.0
                for k in range(len(seen)):
                    alike = _alike(times[t], norths[i], easts[j], seen[k], length)
                    v_n += alike * weights[k, 0]
                    v_e += alike * weights[k, 1]
                current[t, i, j, 0] += v_n
                current[t, i, j, 1] += v_e


def observed(chart: Chart, seen: np.ndarray, error_mps: float, error_km: float) -> Chart:
    """A chart corrected by what was observed: optimal interpolation (Gandin 1963).

    Parameters
    ----------
    chart : Chart
    seen : float64[n, 5]
        Time (s), north, east (m), and the depth-averaged current there, north and east (m/s).
    error_mps, error_km : float
        How far the chart is off at least, and over what distance alike. It is taken to be as far
        off as what was seen, if that is farther.
    """
    if not len(seen):
        return chart
    length, (times, norths, easts, _) = 1e3 * error_km, chart
    charted = np.array([current_on(chart, *one) for one in seen[:, :3]])
    off = seen[:, 3:] - charted
    error_mps = max(error_mps, math.sqrt(float(np.mean(off**2))))

    alike = _alike_each_other(seen, length)
    covariance = error_mps**2 * alike + OBSERVED_STD**2 * np.eye(len(seen))
    weights = error_mps**2 * solve(covariance, off)
    current = chart.current.copy()
    _correct(current, times, norths, easts, seen, weights, length)
    return chart._replace(current=current)


def with_land(chart: Chart, land: np.ndarray) -> Chart:
    """A chart over whose land nothing sails: not a number is no current to sail in."""
    if not land.any():
        return chart
    current = chart.current.copy()
    current[:, land] = np.nan
    return chart._replace(current=current)
