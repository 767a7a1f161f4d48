# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0

from setuptools import find_packages, setup

package_name = 'glider_studies'

setup(
    name=package_name,
    version='1.0.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['*.yaml', 'paper/*.yaml', 'sweep/sweeps/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
    ],
    install_requires=['setuptools', 'glider_bringup', 'dask', 'distributed'],
    extras_require={'test': ['pytest', 'hypothesis']},
    maintainer='The glider stack authors',
    description='Many flights of a glider: sweeps, Monte Carlo, experiments, searches.',
    license='Apache-2.0',
    entry_points={
        'glider.commands': [
            f'{name} = glider_studies.commands.{name}:app'
            for name in ('bounds', 'experiments', 'list', 'map', 'montecarlo', 'sweep')
        ],
        'glider.python': ['sweep = glider_studies.door:sweep'],
    },
)
