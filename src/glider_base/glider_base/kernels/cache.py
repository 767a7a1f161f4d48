# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""Where compiled kernels are kept, and when what is kept is stale (docs/adr/0006).

A kernel is kept under a digest over the sources of all modules that its code can come from: its
own module and what that imports, the modules of the types that it is compiled for, and those of
the bodies that these types choose for slots. Of a file that was written after the start of the
program nobody knows whether the program runs what is in it: nothing that can come from it is kept,
or looked for.
"""

import hashlib
import importlib.util
import os
import pickle
import re
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core import types
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.runtime import rtsys
from numba.core.serialize import dumps

from glider_base.kernels.compiler import OPTIONS

#: Our own packages, whose kernels call each other.
PACKAGES = (
    *('glider_base', 'glider_model', 'glider_navigation', 'glider_guidance', 'glider_control'),
    *('glider_guard', 'glider_mission', 'glider_bringup', 'glider_studies', 'glider_flights'),
)
#: What is kept at most (bytes), and how old it was before it is marked as used again (s).
LARGEST, USED_S = 2_000_000_000, 86_400.0
#: Imports wherever they stand in a line; also what reads like one in a text, which does no harm.
_IMPORT = re.compile(
    r'from[ \t]*([\w.]+)[ \t]+import\b[ \t]*(\([^)]*\)|[^\n;]*)|import[ \t]+([^\n;]*)'
)
#: Where packages of others are installed. Only what holds kernels is looked at there.
_INSTALLED = (f'{os.sep}site-packages{os.sep}', f'{os.sep}dist-packages{os.sep}')


class Body(NamedTuple):
    """A kernel that fills a slot: the modules of the slot, of its params and of the kernel."""

    slot: str
    params: str
    kernel: str


#: Of all slots that have been filled in this process.
BODIES: list[Body] = []
#: Top-level modules that hold kernels.
HOLDERS: set[str] = set()
#: When the program began (s).
_STARTED_S = time.time()


@cache
def _file_of(module: str) -> str | None:
    """Python source of a module, imported or not; None if there is none, or it is of Python."""
    if module.partition('.')[0] in sys.stdlib_module_names and module != '__main__':
        return None
    if module in sys.modules:
        path = getattr(sys.modules[module], '__file__', None)
    elif '.' in module:
        parent, _, name = module.rpartition('.')
        above = _file_of(parent) or ''
        if not above.endswith('__init__.py'):
            return None
        inside = Path(above).parent
        found = (inside / name / '__init__.py', inside / f'{name}.py')
        path = next((str(one) for one in found if one.is_file()), None)
    else:
        try:
            spec = importlib.util.find_spec(module)
        except (ImportError, ValueError):
            return None
        path = spec.origin if spec and spec.has_location else None
    return path if path and path.endswith('.py') else None


def _counts(module: str) -> bool:
    """Whether kernels can come from a module: it is ours, a user's, or of a holder of kernels."""
    path = _file_of(module)
    if path is None:
        return False
    return module.partition('.')[0] in HOLDERS or not any(one in path for one in _INSTALLED)


@cache
def _source(module: str) -> tuple[bytes, frozenset[str]]:
    """Digest of a module, and the modules that it imports."""
    path = _file_of(module)
    data = Path(path).read_bytes()
    package = module if path.endswith('__init__.py') else module.rpartition('.')[0]
    names = set()
    text = data.decode('utf-8', 'replace').replace('\\\n', ' ')
    for origin, members, plain in _IMPORT.findall(text):
        if origin:
            with suppress(ImportError):  # it leads out of the package, and nothing imports it
                origin = importlib.util.resolve_name(origin, package)
            names.add(origin)
            names |= {f'{origin}.{one}' for one in re.findall(r'\w+', members)}
        names |= {part.split()[0] for part in plain.split(',') if part.strip()}
    parents = {name[:at] for name in names for at in range(len(name)) if name[at] == '.'}
    return hashlib.sha256(data).digest(), frozenset(filter(_file_of, names | parents))


def _reach(modules: Iterable[str], seen: dict[str, bytes]) -> None:
    """Add modules and all that they import to those that are seen, with their digests."""
    open_ = [*modules]
    while open_:
        module = open_.pop()
        if module not in seen and _counts(module):
            seen[module], imports = _source(module)
            open_ += imports


@cache
def closure(modules: frozenset[str], bodies: int, kernels: int) -> str | None:
    """Digest of all sources that code of some modules can come from; None if one is too new.

    It is kept for so many of `BODIES` and of kernels: more may change it.
    """
    seen: dict[str, bytes] = {}
    _reach(modules, seen)
    chosen = True
    while chosen:
        chosen = {
            body.kernel
            for body in BODIES[:bodies]
            if body.slot in seen and body.params in seen and body.kernel not in seen
        }
        _reach(chosen, seen)
    paths = [_file_of(module) for module in seen]
    if any(not os.path.isfile(one) or os.stat(one).st_mtime > _STARTED_S for one in paths):
        return None
    digest = hashlib.sha256(numba.__version__.encode())
    for module in sorted(seen):
        digest.update(module.encode() + b'\0' + seen[module])
        if module.partition('.')[0] not in PACKAGES:
            for name, value in sorted(vars(sys.modules.get(module, object)).items()):
                digest.update(b''.join(_held(name, value)))
    return digest.hexdigest()[:16]


def _held(name: str, value: Any) -> Iterator[bytes]:
    """Numbers of a module, as a kernel holds them: wherever they were read from."""
    if isinstance(value, tuple):
        for number, one in enumerate(value):
            yield from _held(f'{name}.{number}', one)
    elif isinstance(value, int | float | complex | np.generic | np.ndarray):
        array = np.asarray(value)
        if not array.dtype.hasobject:
            yield f'{name} {array.dtype.str} {array.shape} '.encode() + array.tobytes()


def _classes(kinds: Iterable) -> Iterator[type]:
    """Classes of NamedTuples among numba types, and in them."""
    for kind in kinds:
        if isinstance(kind, types.BaseNamedTuple):
            yield kind.instance_class
        if isinstance(kind, types.BaseTuple):
            # all of a uniform tuple are alike
            yield from _classes(set(kind.types))
        if isinstance(kind, types.StructRef):
            yield from _classes(kind.field_dict.values())
        if isinstance(kind, types.TypeRef):
            yield from _classes([kind.instance_type])


def is_kept(function) -> bool:
    """Whether a function stands in a file, not in a notebook: then its code is kept."""
    return _is_of(function.__code__.co_filename, _file_of(function.__module__))


@cache
def _is_of(own: str, path: str | None) -> bool:
    """Whether code of a file is that of a module's source."""
    return path is not None and os.path.realpath(path) == os.path.realpath(own)


def folder() -> Path:
    """Folder of the compiled kernels, in ``$GLIDER_CACHE`` or ``~/.cache/glider``."""
    default = f'{os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")}/glider'
    return Path(os.environ.get('GLIDER_CACHE') or default, 'kernels')


class KernelCache(NullCache):
    """What was compiled of a kernel: a file for each signature, written at once or not at all."""

    made = 0  #: so many; for a kernel that is imported anew, another one

    def __init__(self, function, ending: str = '') -> None:
        KernelCache.made += 1
        self._function, self._ending = function, ending  #: of the names of its files
        HOLDERS.add(function.__module__.partition('.')[0])

    @property
    def cache_path(self) -> str:
        """Folder of the kernels of its module, wherever their source lies."""
        return str(folder() / self._function.__module__)

    def _file(self, sig, codegen) -> Path | None:
        """Where the code for a signature is kept; None if it can be of no use to another session.

        Classes of a notebook, the program itself and functions are made anew in each session.
        """
        kinds = getattr(sig, 'args', sig)
        classes = list(_classes(kinds))
        if any(one.__module__ == '__main__' or '<locals>' in one.__qualname__ for one in classes):
            return None
        own = self._function
        modules = {one.__module__ for one in classes} | {own.__module__}
        digest = closure(frozenset(modules), len(BODIES), KernelCache.made)
        if digest is None:
            return None
        code, cells = own.__code__, [cell.cell_contents for cell in own.__closure__ or ()]
        names = sorted({f'{one.__module__}.{one.__qualname__}' for one in classes})
        told = [kind.name for kind in kinds], names, code.co_firstlineno, code.co_code
        told = repr((sys.implementation.cache_tag, codegen.magic_tuple(), *told))
        told += repr(dumps(cells)) if cells else ''
        which = hashlib.sha256(told.encode()).hexdigest()[:16]
        return Path(self.cache_path, f'{own.__qualname__}{self._ending}.{digest}.{which}')

    def load_overload(self, sig, target_context):
        """What was compiled for a signature, or None."""
        path = self._file(sig, target_context.codegen())
        if path is None:
            return None
        if OPTIONS:  # else numba loads all that it compiles with
            rtsys.initialize(target_context)
        else:
            target_context.refresh()
        try:
            found = pickle.loads(path.read_bytes())
            if time.time() - path.stat().st_mtime > USED_S:
                os.utime(path)
        except (OSError, EOFError, pickle.UnpicklingError):  # none, or cut by a crash
            return None
        return CompileResult._rebuild(target_context, *found)

    def save_overload(self, sig, data) -> None:
        """Save what was compiled for a signature, if it can be of use to another session."""
        path = self._file(sig, data.codegen)
        if path is None or data.library.has_dynamic_globals:
            return
        partial = path.with_name(f'{path.name}.{os.getpid()}')
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            partial.write_bytes(dumps(data._reduce()))
            partial.replace(path)
        except OSError as error:
            _say_unkept(str(folder()), error.strerror)


@cache
def _say_unkept(place: str, why: str) -> None:
    """Say once why each command compiles anew."""
    print(
        f'compiled mathematics cannot be kept in {place}: {why}; every command compiles it anew '
        '(allowed: GLIDER_CACHE = a folder that can be written)',
        file=sys.stderr,
    )


def forget_old(largest: int = LARGEST) -> None:
    """Remove what has not been used for longest, until the rest is not larger (bytes)."""
    found = []
    for path in folder().rglob('*'):
        with suppress(FileNotFoundError):  # its name was for the time of writing
            status = path.stat()
            found += [(status.st_mtime, status.st_size, path)] if path.is_file() else []
    size = sum(one[1] for one in found)
    for _, own, path in sorted(found):
        if size <= largest:
            return
        size -= own
        path.unlink(missing_ok=True)
