# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0

from setuptools import find_packages, setup

package_name = 'glider_flights'

setup(
    name=package_name,
    version='1.0.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['*.yaml']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
    ],
    install_requires=['setuptools', 'glider_bringup'],
    extras_require={'test': ['pytest', 'hypothesis']},
    maintainer='The glider stack authors',
    description='Recorded flights of real gliders: their files, navigation over them, validation.',
    license='Apache-2.0',
    entry_points={
        'glider.commands': [
            f'{name} = glider_flights.commands.{name}:app'
            for name in ('energy', 'navigate', 'validate')
        ],
    },
)
