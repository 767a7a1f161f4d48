# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Which files a bag consists of."""

from pathlib import Path

from glider_base.files import read_yaml
from glider_base.settings import ConfigurationError
from glider_mission.recording.metadata import METADATA_FILE


def bag_files(path: Path) -> list[Path]:
    """MCAP files of a bag, in the order in which they were written.

    Raises
    ------
    ConfigurationError
        If there is none, or one of those that metadata.yaml lists is missing.
    """
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise ConfigurationError(f'{path}: no such run, bag folder or .mcap file')
    listed = _listed_files(path / METADATA_FILE)
    files = listed or sorted(path.glob('*.mcap'))
    if not files:
        raise ConfigurationError(
            f'{path}: no .mcap file in it (allowed: the folder of a bag, of a run over nodes, or '
            f'of a direct one with --bag)'
        )
    for file in files:
        if not file.is_file():
            raise ConfigurationError(f'{file}: missing; {path / METADATA_FILE} lists it')
    return files


def _listed_files(metadata: Path) -> list[Path]:
    """Files that metadata.yaml lists; none if there is no such file."""
    if not metadata.is_file():
        return []
    try:
        values = read_yaml(metadata)
        information = values['rosbag2_bagfile_information']
        names = [str(name) for name in information['relative_file_paths']]
        storage = information['storage_identifier']
        compression = information.get('compression_format') or ''
    except (KeyError, TypeError, AttributeError) as error:
        raise ConfigurationError(f'{metadata}: not metadata of rosbag2: {error!r}') from None
    if storage != 'mcap' or compression:
        what = f'files compressed with {compression}' if compression else f'storage {storage}'
        raise ConfigurationError(
            f'{metadata}: {what} (allowed: storage mcap, compressed in chunks or not at all; '
            f'ros2 bag convert makes one)'
        )
    return [metadata.parent / name for name in names]


def has_bag(run: Path) -> bool:
    """Whether a run folder holds a bag, or is one: a single MCAP file."""
    return run.is_file() or any(run.glob('*.mcap'))
