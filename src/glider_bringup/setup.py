# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0

from glob import glob

from setuptools import find_packages, setup

package_name = 'glider_bringup'

setup(
    name=package_name,
    version='1.0.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['showing/web/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
        (f'share/{package_name}/launch', glob('launch/*.launch.py')),
        (f'share/{package_name}/layouts', glob('layouts/*')),
        (f'share/{package_name}/security', glob('security/*')),
    ],
    install_requires=[
        'setuptools',
        'glider_mission',
        'jinja2',
        'matplotlib',
        'plotly',
        'rich',
        'typer',
        'xarray',
    ],
    extras_require={'test': ['pytest', 'hypothesis']},
    maintainer='The glider stack authors',
    description='Flying an underwater glider: runner, recorder, score, report, command line.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'autopilot = glider_bringup.nodes.autopilot:main',
            'recorder_node = glider_bringup.nodes.recorder_node:main',
            'viewer_node = glider_bringup.nodes.viewer_node:main',
            'glider = glider_bringup.cli:main',
        ],
    },
)
