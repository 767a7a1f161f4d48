# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Trims and lists from Python."""

from pathlib import Path

from glider_mission.scenario import read_scenario, scenario_names
from glider_model.plant.trim import Trim, solve_trim
from glider_model.vehicle.file import load_vehicle, vehicle_names


def scenarios() -> dict[str, str]:
    """Names of the scenarios that come with the stack, and what each shows."""
    return {name: read_scenario(name).values['description'] for name in scenario_names()}


def vehicles() -> dict[str, str]:
    """Names of the vehicles that come with the stack, and what each is."""
    return {name: load_vehicle(name).description for name in vehicle_names()}


def trim(
    vehicle: str | Path,
    net_heaviness_kg: float,
    *,
    pitch_deg: float | None = None,
    pitch_mass_m: float | None = None,
    roll_mass_deg: float = 0.0,
    fin_deg: float = 0.0,
) -> Trim:
    """Steady glide or spiral of a vehicle, as ``./glider trim`` solves it.

    Parameters
    ----------
    vehicle : str or Path
        By name, or path of its YAML file.
    net_heaviness_kg : float
        Positive sinks (kg).
    pitch_deg, pitch_mass_m : float, optional
        One of them: pitch (deg, nose up), or the pitch mass from its neutral position (m).
    roll_mass_deg : float
        Roll mass, positive to starboard (deg).
    fin_deg : float
        Tail fin, or other steering surface, positive to starboard (deg).

    Returns
    -------
    Trim
        Its field ``converged`` is False if there is no steady state.

    Raises
    ------
    ConfigurationError
        If both or neither of pitch and pitch mass are given, or an actuator does not go there.
    """
    params = load_vehicle(str(vehicle)).params()
    return solve_trim(params, net_heaviness_kg, pitch_deg, pitch_mass_m, roll_mass_deg, fin_deg)
