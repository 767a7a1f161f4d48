# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0

from setuptools import find_packages, setup

package_name = 'glider_mission'

setup(
    name=package_name,
    version='1.0.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['scenarios/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
    ],
    install_requires=[
        'setuptools',
        'glider_control',
        'glider_guard',
        'glider_guidance',
        'glider_navigation',
        'lz4',
        'mcap',
        'zstandard',
    ],
    extras_require={'test': ['pytest', 'hypothesis']},
    maintainer='The glider stack authors',
    description='Missions of an underwater glider: scenarios, the blocks of a tick, recordings.',
    license='Apache-2.0',
)
