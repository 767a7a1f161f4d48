# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Datasets as NetCDF files."""

from pathlib import Path

import xarray


def write_dataset(dataset: xarray.Dataset, file: Path) -> None:
    """Write NetCDF 3, which has no dates in it and which every reader of NetCDF opens."""
    plain = {name: {'_FillValue': None} for name in dataset.coords}
    dataset.to_netcdf(file, engine='scipy', format='NETCDF3_64BIT', encoding=plain)


def read_dataset(file: Path) -> xarray.Dataset:
    """Read a file into memory; OSError or ValueError if it cannot be read."""
    with xarray.open_dataset(file, engine='scipy') as dataset:
        return dataset.load()
