# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Forecast of the current of the next dive from those of the dives before it, and of no others."""

import numpy as np

#: Standard deviations that the current of a region may have (m/s).
SCALES_MPS = (0.02, 0.05, 0.1, 0.2, 0.4)
#: The current departs from its mean, and returns to it, over this time (s): four days.
MEMORY_S = 4 * 86_400.0
#: Interpolation has proven itself by no fewer forecasts than these.
PROOF = 6
#: Dives before these tell nothing more of the next one.
REMEMBERED = 100
#: Names of the forecasts.
FORECASTS = ('none', 'persistence', 'ours')
#: Error of a depth-averaged current itself, of each component (m/s): 0.8 cm/s of both together.
ERROR_MPS = 0.0057


def interpolated(told_s: np.ndarray, told_mps: np.ndarray, at_s: float) -> np.ndarray:
    """Optimal interpolation in time of a constant mean and red noise about it, shape (2,) (m/s).

    Persistence, less what of it is the error of a single dive. How strong currents are here is
    learnt: each of `SCALES_MPS` counts as much as it makes the dives so far likely.

    Parameters
    ----------
    told_s : ndarray, shape (n,)
        Middle of each of the dives before (s).
    told_mps : ndarray, shape (n, 2)
        Their currents (m/s).
    at_s : float
        Middle of the next dive (s).
    """
    apart = np.exp(-np.abs(told_s[:, None] - told_s) / MEMORY_S)
    ahead = np.exp(-np.abs(at_s - told_s) / MEMORY_S)
    forecasts, likelihoods = [], []
    for scale in SCALES_MPS:
        covariance = scale**2 * (1.0 + apart) + ERROR_MPS**2 * np.eye(len(told_s))
        weighted = np.linalg.solve(covariance, told_mps)
        forecasts.append(scale**2 * (1.0 + ahead) @ weighted)
        # Of two components with the same covariance.
        spread = np.linalg.slogdet(covariance)[1]
        likelihoods.append(-0.5 * np.sum(told_mps * weighted) - spread)
    weights = np.exp(np.array(likelihoods) - max(likelihoods))
    return weights @ np.array(forecasts) / weights.sum()


class Forecaster:
    """Forecasts for one dive after the other; told of each when it is over.

    `ours` is persistence, until optimal interpolation would have missed the surfacings of this
    flight by less, over at least `PROOF` of them.
    """

    def __init__(self) -> None:
        self.told_s: list[float] = []
        self.told_mps: list[np.ndarray] = []
        self.missed_m: dict[str, list[float]] = {'persistence': [], 'interpolated': []}
        self._tried: dict[str, np.ndarray] = {}

    def forecast(self, at_s: float) -> dict[str, np.ndarray]:
        """Currents (m/s), shape (2,), at the middle of the next dive (s), by name of forecast."""
        if not self.told_s:
            return {}
        told_s = np.array(self.told_s[-REMEMBERED:])
        told_mps = np.array(self.told_mps[-REMEMBERED:])
        self._tried = {
            'persistence': told_mps[-1],
            'interpolated': interpolated(told_s, told_mps, at_s),
        }
        best = 'persistence'
        if len(self.missed_m[best]) >= PROOF:
            best = min(self.missed_m, key=lambda name: np.mean(self.missed_m[name]))
        return {
            'none': np.zeros(2),
            'persistence': self._tried['persistence'],
            'ours': self._tried[best],
        }

    def tell(self, at_s: float, current_mps: np.ndarray, seconds: float) -> None:
        """Take in the current of a dive (m/s) with its middle (s) and how long it was (s)."""
        for name, tried in self._tried.items():
            self.missed_m[name].append(float(np.hypot(*(current_mps - tried))) * seconds)
        self.told_s.append(at_s)
        self.told_mps.append(current_mps)
