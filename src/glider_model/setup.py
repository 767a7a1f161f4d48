# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0

from setuptools import find_packages, setup

package_name = 'glider_model'

setup(
    name=package_name,
    version='1.0.0',
    packages=find_packages(exclude=['test']),
    package_data={package_name: ['vehicle/vehicles/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{package_name}']),
        (f'share/{package_name}', ['package.xml']),
    ],
    install_requires=['setuptools', 'glider_base', 'scipy', 'xarray'],
    extras_require={'test': ['pytest', 'hypothesis']},
    maintainer='The glider stack authors',
    description='Underwater glider, water and frames as pure step functions, and their nodes.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'plant_node = glider_model.nodes.plant_node:main',
            'current_node = glider_model.nodes.current_node:main',
            'tf_node = glider_model.nodes.tf_node:main',
        ],
    },
)
