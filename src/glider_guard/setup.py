# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0

from setuptools import find_packages, setup

package_name = 'glider_guard'

setup(
    name=package_name,
    version='1.0.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
    ],
    install_requires=['setuptools', 'glider_model'],
    extras_require={'test': ['pytest', 'hypothesis']},
    maintainer='The glider stack authors',
    description='Guard of an underwater glider: monitors, and the last word on the command.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'guard_node = glider_guard.nodes.guard_node:main',
        ],
    },
)
