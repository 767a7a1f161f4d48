# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The one decorator that compiles the mathematics, and where compiled code is kept.

numba decides whether a cached function is stale by looking at the file that defines it, not at the
files of the functions it calls. A change in ``hydrodynamics.py`` would go unnoticed in a cached
``plant_step``. The cache folder is therefore named by a digest over the sources of all packages
whose kernels call each other, those of other distributions that fill a slot among them: change any
of them and everything is compiled afresh.
"""

import fcntl
import hashlib
import importlib.util
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numba
from numba.core import event
from numba.core.caching import FunctionCache

from glider_model.base.plugins import registered, sources

#: Packages whose kernels call each other.
PACKAGES = (
    *('glider_model', 'glider_navigation', 'glider_guidance', 'glider_control', 'glider_guard'),
    'glider_bringup',
)


@cache
def source_digest() -> str:
    """Digest of the sources of our packages, and of those that registered something."""
    digest = hashlib.sha256(numba.__version__.encode())
    for name in PACKAGES:
        spec = importlib.util.find_spec(name)
        if spec is None or not spec.submodule_search_locations:
            continue
        folder = Path(spec.submodule_search_locations[0])
        for path in sorted(folder.rglob('*.py')):
            digest.update(str(path.relative_to(folder)).encode())
            digest.update(path.read_bytes())
    for point in registered():
        digest.update(f'{point.group} {point.name} {point.value}'.encode())
    for path in sources():
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> Path:
    """Folder of the compiled kernels, in ``$GLIDER_CACHE`` or ``~/.cache/glider``."""
    default = Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache') / 'glider'
    return Path(os.environ.get('GLIDER_CACHE') or default) / f'kernels-{source_digest()}'


if not os.environ.get('NUMBA_CACHE_DIR'):
    numba.config.CACHE_DIR = str(cache_folder())


class _Cache(FunctionCache):
    """numba's cache of a function, which one process at a time adds to.

    numba looks for a free name, writes the index and then the file. Two processes that compile a
    function for different types at the same time would give their code the same name, and one of
    them would later run that of the other.
    """

    def save_overload(self, sig, data) -> None:
        """Save what was compiled for a signature."""
        os.makedirs(self.cache_path, exist_ok=True)
        with open(os.path.join(self.cache_path, 'lock'), 'w') as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            super().save_overload(sig, data)


def kernel(function: Callable) -> numba.core.dispatcher.Dispatcher:
    """Compile a pure function, when it is called first.

    No fastmath: IEEE arithmetic in source order is what makes a run over topics and a direct run
    agree to the last bit. Inlined into its callers: a NamedTuple would otherwise be copied number
    by number at every call.
    """
    compiled = numba.njit(error_model='numpy', forceinline=True)(function)
    compiled._cache = _Cache(function)  # as its enable_caching() does
    return compiled


class _Once(event.Listener):
    """Calls ``tell`` when numba begins to compile for the first time."""

    def __init__(self, tell: Callable[[], None]) -> None:
        self._tell = [tell]

    def on_start(self, event) -> None:
        if self._tell:
            self._tell.pop()()

    def on_end(self, event) -> None:
        pass


@contextmanager
def compiling_told(tell: Callable[[], None]) -> Iterator[None]:
    """Call ``tell`` once if something in the block has to be compiled, before it is.

    What is found in the cache is not compiled.
    """
    with event.install_listener('numba:compile', _Once(tell)):
        yield
