# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""What numba does for kernels in vain, and is spared here (docs/adr/0009).

That is machine code of kernels that others inline, bitcode of those that nobody inlines, counts of
references in tuples that have none, and passes over loops in what has been inlined. All of it
stands on what is not public in numba, as does the refusal of what draws random numbers.
With any other numba than the one that it was written for, kernels are compiled as numba does it.
With any of them, Python looks for no garbage while something is compiled.
"""

import gc

import numba
from numba.core import errors, event
from numba.core.codegen import JITCodeLibrary, JITCPUCodegen, ll
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.environment import lookup_environment
from numba.core.runtime.context import NRTContext
from numba.core.typed_passes import NativeLowering
from numba.core.typing import typeof

WRITTEN_FOR = '0.61.'
#: Kinds of a library in the cache: of a kernel that others inline, of one that is called.
_BITCODE, _MACHINE_CODE = 'inlined', 'called'
#: How names of environments of functions begin in a module.
_ENVIRONMENT = '_ZN08NumbaEnv'
#: What random numbers are drawn from: NumPy's, and Python's.
_RANDOM = 'numba_get_np_random_state', 'numba_get_py_random_state'
#: Code of so many basic blocks, as the tick of a block has, is large. Passes over it, by their
#: names in llvmlite, are those of -O3, but none over loops.
_LARGE = 500
_BEFORE_INLINING = ('cfg_simplification', 'sroa')
_AFTER_INLINING = (
    *('ipsccp', 'sroa', 'instruction_combining', 'cfg_simplification', 'jump_threading'),
    *('cfg_simplification', 'gvn', 'memcpy_optimization', 'sccp', 'instruction_combining'),
    *('jump_threading', 'dead_store_elimination', 'aggressive_dead_code_elimination'),
    *('cfg_simplification', 'instruction_combining', 'global_dce'),
)
#: What is inlined though nobody said so, in instructions, as at -O3.
_SMALL = 275


def _blocks_of(module):
    return sum(1 for function in module.functions for _ in function.blocks)


class _Library(JITCodeLibrary):
    """Code of a kernel. The engine that makes machine code never gets one that is inlined."""

    is_kernel = is_inlined = is_read = False

    def _optimize_final_module(self):
        is_run = self.is_kernel and not self.is_inlined
        if not is_run or _blocks_of(self._final_module) < _LARGE:
            return super()._optimize_final_module()
        passes = ll.create_module_pass_manager()
        passes.add_target_library_info(ll.get_process_triple())
        self._codegen._tm.add_analysis_passes(passes)
        passes.add_type_based_alias_analysis_pass()
        passes.add_basic_alias_analysis_pass()
        for name in _BEFORE_INLINING:
            getattr(passes, f'add_{name}_pass')()
        passes.add_function_inlining_pass(_SMALL)
        passes.add_refprune_pass()
        for name in _AFTER_INLINING:
            getattr(passes, f'add_{name}_pass')()
        passes.run(self._final_module)

    def _finalize_final_module(self):
        if not self.is_inlined:
            return super()._finalize_final_module()
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True

    def get_pointer_to_function(self, name):
        """Address of a function; 0 of one that is inlined, for there is none."""
        if self.is_read:  # what it defines was not listed
            return self._codegen._engine.get_function_address(name)
        return 0 if self.is_inlined else super().get_pointer_to_function(name)

    @property
    def codegen(self):
        """What sets environments of functions: one that is inlined gets its with its caller."""
        return self if self.is_inlined else super().codegen

    def set_env(self, name, env):
        """Nothing to set before it is inlined."""

    def serialize_using_object_code(self):
        """What goes to the cache: nobody inlines a kernel that is called."""
        if not self.is_kernel:
            return super().serialize_using_object_code()
        self._ensure_finalized()
        if self.is_inlined:
            return self.name, _BITCODE, self._get_module_for_linking().as_bitcode()
        return self.name, _MACHINE_CODE, self._get_compiled_object()

    @classmethod
    def _unserialize(cls, codegen, state):
        name, kind, data = state
        if kind not in (_BITCODE, _MACHINE_CODE):
            return super()._unserialize(codegen, state)
        library = cls(codegen, name)
        if kind == _BITCODE:
            library.is_inlined = library._finalized = True
            library._shared_module = ll.parse_bitcode(data)
            return library
        library.enable_object_caching()
        library._set_compiled_object(data)
        library._finalize_final_module()
        library.is_read = True
        return library


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(NativeLowering):
    """Makes code of a kernel whose types are known."""

    _name = 'kernel_lowering'

    def run_pass(self, state):
        codegen, flags = state.targetctx.codegen(), state.flags
        library = state.library = codegen.create_library(state.func_id.func_qualname)
        library.enable_object_caching()
        library.is_kernel = True
        library.is_inlined = bool(flags.forceinline and flags.no_cpython_wrapper)
        changed = super().run_pass(state)
        if any(one.name in _RANDOM for one in library._final_module.functions):
            raise errors.UnsupportedError('it draws random numbers, and no run would be repeated')
        if not library.is_inlined:
            for name in (one.name for one in library._final_module.global_variables):
                env = lookup_environment(name) if name.startswith(_ENVIRONMENT) else None
                if env is not None:
                    codegen.set_env(name, env)
        return changed


class KernelCompiler(CompilerBase):
    """Compiles kernels: an option of `numba.njit`."""

    def define_pipelines(self):
        """As numba has them, but for the last step."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.passes = [
            (_Lowering if one is NativeLowering else one, text) for one, text in passes.passes
        ]
        passes.finalize()
        return [passes]


_meminfos = NRTContext.get_meminfos
#: Whether anything is counted in values of a type.
_is_counted = {}


def _meminfos_if_any(self, builder, kind, value):
    """What is counted in a value, without taking it apart where nothing is."""
    if kind not in _is_counted:
        _is_counted[kind] = self._context.data_model_manager[kind].contains_nrt_meminfo()
    return _meminfos(self, builder, kind, value) if _is_counted[kind] else []


_typeof_of_any = typeof.typeof_impl
_typeof_of_tuple = _typeof_of_any.dispatch(tuple)


def _typeof(value, context):
    """Type of a value; of a tuple without asking of its class whether it is any other kind."""
    of = _typeof_of_tuple if isinstance(value, tuple) else _typeof_of_any
    return of(value, context)


class _Uncollected(event.Listener):
    """Has Python look for no garbage from the outermost compilation's start to its end."""

    def __init__(self) -> None:
        self._depth, self._was_on = 0, False

    def on_start(self, event) -> None:
        if not self._depth:
            self._was_on = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, event) -> None:
        self._depth -= 1
        if not self._depth and self._was_on:
            gc.enable()


event.register('numba:compile', _Uncollected())
#: Options of `numba.njit` for kernels.
OPTIONS = {}
if numba.__version__.startswith(WRITTEN_FOR):
    OPTIONS['pipeline_class'] = KernelCompiler
    JITCPUCodegen._library_class = _Library  # also of what is read from the cache
    NRTContext.get_meminfos = _meminfos_if_any
    typeof.typeof_impl = _typeof
