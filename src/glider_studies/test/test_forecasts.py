# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Dead reckoning by forecasts that err: what is asked of it, and what is flown."""

import json

import numpy as np
import pytest

from glider_model.ocean.eddying_sea import EddyingSea, currents, write_sea
from glider_studies import forecasts
from glider_studies.forecasts import CASES, ERRORS, PERSISTENCE, WAYS, judge, scenario_in
from glider_studies.paper.experiments import fly, verdict_of


def rows(**shares):
    """Persistence is off by 100 m, a whole forecast by 60, 90, 200 m; its share by these."""
    off = {(PERSISTENCE, 0.0): 100.0}
    off |= dict(
        zip([('whole forecast', error) for error in ERRORS], (60.0, 90.0, 200.0), strict=True)
    )
    off |= {('its share', error): shares[f'off_{k}'] for k, error in enumerate(ERRORS)}
    return [
        {'way': way, 'error_mps': error, 'p50_m': off[way, error], 'p90_m': 3.0 * off[way, error]}
        for way, error in CASES
    ]


@pytest.mark.parametrize(
    ('shares', 'failed'),
    [
        ((65.0, 95.0, 105.0), set()),
        ((67.0, 95.0, 105.0), {0, 1}),
        ((65.0, 100.0, 105.0), {2, 3}),
        ((65.0, 95.0, 111.0), {4, 5}),
    ],
)
def test_its_share_is_held_to_the_better_of_both_at_every_error(shares, failed):
    checks = judge(rows(**{f'off_{k}': off for k, off in enumerate(shares)}))
    assert {number for number, check in enumerate(checks) if not check.passed} == failed


def test_the_study_can_be_printed_as_json():
    """Its seas flown by nobody: each came up 10, 20 and 30 m off."""

    class Pool:
        def results(self, function, tasks, progress):
            return {key: [10.0, 20.0, 30.0] for key in tasks}

    one = forecasts.experiment(0)
    entry = json.loads(json.dumps(verdict_of(one, *fly([one], Pool(), None)[0])))
    assert entry['verdict'] == 'passed'
    assert {(row['surfacings'], row['p50_m']) for row in entry['rows']} == {(12, 20.0)}
    assert [check['value'] for check in entry['checks']] == [1.0] * (2 * len(ERRORS))


def test_a_forecast_is_off_by_what_it_says_and_its_sea_is_the_same(tmp_path):
    sea = EddyingSea(seed=2000, rms_mps=0.42)
    told = {error: currents(sea.model_copy(update={'error_mps': error})) for error in ERRORS}
    depths = told[0.0][0]['depth']
    for error in ERRORS[1:]:
        off = [told[error][k] - told[0.0][k] for k in (1, 2)]
        means = [np.trapezoid(one, depths, axis=1) / np.ptp(depths) for one in off]
        assert np.sqrt(np.mean(np.square(means))) == pytest.approx(error, rel=0.02)
    for file in 'sea.nc', 'forecast.nc':
        write_sea(sea, tmp_path / file)
    for way in WAYS:
        flown = scenario_in(tmp_path / 'sea.nc', tmp_path / 'forecast.nc', way)
        settings = flown.navigation_settings()
        assert settings.forecast.share_std == WAYS[way]
        assert settings.params().method.forecast.is_used
        assert flown.current.field.file != settings.forecast.field.file


def test_a_perfect_forecast_leads_a_vehicle_nearer_than_none(monkeypatch):
    monkeypatch.setattr(forecasts, 'DURATION_S', 20.0 * 3600.0)
    monkeypatch.setattr(forecasts, '_SETTLED', 1)
    without, with_it = (
        forecasts.fly_one((2000, 0.42, way, 0.0)) for way in (PERSISTENCE, 'its share')
    )
    assert min(len(without), len(with_it)) >= 3
    assert np.median(with_it) < 0.7 * np.median(without)
