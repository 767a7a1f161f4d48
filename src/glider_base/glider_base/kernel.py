# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""The one decorator that compiles the mathematics, what tells that it does, and `replace`."""

import hashlib
import importlib.util
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import NamedTuple, TypeVar

import numba
from numba.core import event
from numba.extending import overload

from glider_base.kernels import compiler
from glider_base.kernels.cache import PACKAGES, KernelCache, is_kept
from glider_base.plugins import registered, sources

Values = TypeVar('Values', bound=NamedTuple)


#: What all are compiled with: IEEE arithmetic, and no wrapper for C.
_OPTIONS = {'error_model': 'numpy', 'no_cfunc_wrapper': True, **compiler.OPTIONS}
#: What functions that kernels alone call are compiled with beside that, to be inlined.
INLINED = {**_OPTIONS, 'no_cpython_wrapper': True, 'forceinline': True}


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


def kernel(function: Callable) -> numba.core.dispatcher.Dispatcher:
    """Compile a pure function, when it is called first.

    No fastmath: IEEE arithmetic in source order is what makes a run over topics and a direct run
    agree to the last bit. Inlined into its callers: a NamedTuple would otherwise be copied number
    by number at every call.

    What unpacks the arguments of a call from Python is long to compile, and kernels do not need
    it of each other: they get a twin without, by a dispatcher of its own behind that of Python,
    which is made when a kernel that calls it is compiled. Where all is compiled there is none.
    With NUMBA_DISABLE_JIT=1 it stays what it was, for a debugger and for tests of mutants.
    """
    if numba.config.DISABLE_JIT:
        return function
    compiled = _compiled(function, forceinline=True)

    @cache
    def inlined() -> numba.core.dispatcher.Dispatcher:
        return _compiled(function, '.inlined', **INLINED)

    compiled.get_call_template = lambda *arguments: inlined().get_call_template(*arguments)
    compiled.get_overload = lambda signature: inlined().get_overload(signature)
    return compiled


def _compiled(function: Callable, ending: str = '', **options) -> numba.core.dispatcher.Dispatcher:
    """What compiles a function when it is called, and finds again what it compiled before."""
    compiled = numba.njit(**{**_OPTIONS, **options})(function)
    if is_kept(function):
        compiled._cache = KernelCache(function, ending)  # as its enable_caching() does
    return compiled


def replace(values: Values, **changes) -> Values:
    """The same NamedTuple with other values of the fields that are named.

    Examples
    --------
    >>> replace(state, tick=0, reported=state.reported | ORDERED)
    """
    return values._replace(**changes)


@overload(replace, jit_options=INLINED, strict=False)
def _replaced(values, **changes):
    """Write the constructor out, as numba has it: all fields, in their order."""
    made = values.instance_class
    if unknown := set(changes) - set(made._fields):
        raise TypeError(f'{made.__name__} has no field {", ".join(sorted(unknown))}')
    fields = (name if name in changes else f'values.{name}' for name in made._fields)
    # numba tells the calls of a kernel apart by the types of their arguments alone: one that is
    # never given has the names
    arguments = ', '.join(['values', *changes, f'which={" ".join(changes)!r}'])
    names = {'made': made}
    exec(f'def replaced({arguments}): return made({", ".join(fields)})', names)
    return names['replaced']


#: Tells that something is compiled; may return what is to be called when it is done.
Tell = Callable[[], Callable[[], None] | None]


class _Compiling(event.Listener):
    """Tells when numba begins to compile, and ends what it has said when it has."""

    def __init__(self, tell: Tell) -> None:
        self._tell, self._depth, self._is_shown = tell, 0, False
        self._end: Callable[[], None] | None = None

    def on_start(self, event) -> None:
        if not self._depth and (self._end or not self._is_shown):
            self._end, self._is_shown = self._tell(), True
        self._depth += 1

    def on_end(self, event) -> None:
        self._depth -= 1
        if not self._depth and self._end:
            self._end()


@contextmanager
def on_compiling(tell: Tell) -> Iterator[None]:
    """Call ``tell`` if something in the block has to be compiled, before it is.

    What is found in the cache is not compiled. If ``tell`` returns a function, this is called when
    it is compiled, and ``tell`` again for what comes later; else it is called once.
    """
    with event.install_listener('numba:compile', _Compiling(tell)):
        yield
