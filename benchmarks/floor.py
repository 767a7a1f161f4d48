# Copyright 2026 The glider stack authors
# SPDX-License-Identifier: Apache-2.0
"""A tick of the plant in flight, and the same arithmetic in C99, as cc compiles it: the baseline.

The C is in ``floor/``. What it shares with the Python is not written twice: structs and constants
are generated from the Python into ``names.h``, and states and parameters are handed over. Built
without -ffast-math and without contraction, it computes the same bits.
"""

import ctypes
import re
import shutil
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from glider_base.frames import water_from_wire
from glider_base.kernel import kernel
from glider_base.signals import TICK_S, Joints, Water
from glider_bringup.engines.direct import fly_blocks
from glider_bringup.engines.flight import mission_of
from glider_mission.blocks import COLUMNS
from glider_mission.scenario import Scenario
from glider_model.plant import motion, plant
from glider_model.plant.plant import plant_step
from glider_model.vehicle import hydrodynamics, rigid_body

#: Dives, turns, the surface: straight path, constant current, no noise.
SCENARIO = 'current_8deg'
SHALLOW = {
    'dives': 0,
    'duration_s': 6000.0,
    'profile.depth_m': 150.0,
    'profile.surface_every_dives': 2,
}
#: A fin, a volume, and water of which temperature and density are measured.
_FIN = {'range': 26.0, 'rate': 1.2, 'area': 0.02, 'lift_slope': 2.5, 'x': -1.0, 'turn_rate': 0.5}
SEA = {
    **{f'vehicle.fin.{name}': value for name, value in _FIN.items()},
    'vehicle.volume': 69.0 / 1025.0,
    'vehicle.compressibility': 5e-10,
    'vehicle.thermal_expansion': 7e-5,
    'vehicle.reference_temperature': 15.0,
    'water.profile': [[0.0, 1025.0, 18.0], [60.0, 1026.5, 12.0], [1000.0, 1032.0, 5.0]],
}

SOURCES = Path(__file__).parent / 'floor'
#: As fast as IEEE arithmetic in source order allows: no -ffast-math, no fused multiply-add.
FLAGS = ['-std=c99', '-O3', '-march=native', '-ffp-contract=off']

_MODULES = (rigid_body, hydrodynamics, motion, plant)
_SCALARS = {
    bool: (ctypes.c_bool, 'bool'),
    int: (ctypes.c_int64, 'int64_t'),
    float: (ctypes.c_double, 'double'),
    np.uint64: (ctypes.c_uint64, 'uint64_t'),
}
_DTYPES = {
    np.dtype(np.float64): (ctypes.POINTER(ctypes.c_double), 'const double *'),
    np.dtype(np.int64): (ctypes.POINTER(ctypes.c_int64), 'const int64_t *'),
    np.dtype(np.uint64): (ctypes.POINTER(ctypes.c_uint64), 'const uint64_t *'),
}


def compiler() -> str | None:
    """Path of a C compiler, if there is one."""
    return shutil.which('cc')


def compiler_version() -> str | None:
    """What the C compiler says it is, if there is one."""
    if not compiler():
        return None
    done = subprocess.run([compiler(), '--version'], capture_output=True, text=True)
    return done.stdout.partition('\n')[0]


class Structs:
    """C structs of the NamedTuples that are met."""

    def __init__(self) -> None:
        self._types: dict[type, type] = {}
        self.text = ''  #: their typedefs

    def declare(self, value) -> tuple[type, str, str]:
        """C type of a value: for ctypes, and what stands before and after a member's name."""
        if isinstance(value, np.ndarray):
            return *_DTYPES[value.dtype], ''
        if hasattr(value, '_fields'):
            return self._struct(value), f'{type(value).__name__} ', ''
        if isinstance(value, tuple):
            element, before, after = self.declare(value[0])
            return element * len(value), before, f'[{len(value)}]{after}'
        scalar, name = next(c for kind, c in _SCALARS.items() if isinstance(value, kind))
        return scalar, f'{name} ', ''

    def _struct(self, value) -> type:
        kind = type(value)
        if kind not in self._types:
            members = [(name, *self.declare(getattr(value, name))) for name in value._fields]
            fields = [(name, one) for name, one, _, _ in members]
            self._types[kind] = type(kind.__name__, (ctypes.Structure,), {'_fields_': fields})
            lines = [f'    {before}{name}{after};\n' for name, _, before, after in members]
            self.text += f'typedef struct {{\n{"".join(lines)}}} {kind.__name__};\n\n'
        return self._types[kind]

    def make(self, value):
        """Convert a value to C; arrays are referred to, so that the value has to outlive it."""
        one, _, _ = self.declare(value)
        if isinstance(value, np.ndarray):
            return np.ascontiguousarray(value).ctypes.data_as(one)
        if isinstance(value, tuple):
            return one(*(self.make(part) for part in value))
        return one(value)


def _constants() -> str:
    """Macros of the constants of the modules."""
    found = {}
    for module in _MODULES:
        for name, value in vars(module).items():
            if re.fullmatch('[A-Z][A-Z0-9_]*', name) and isinstance(value, int | float):
                if found.setdefault(name, value) != value:
                    raise ValueError(f'{name} of {module.__name__} has two values')
    return ''.join(f'#define {name} ({value!r})\n' for name, value in found.items())


class Floor:
    """The compiled baseline; its structs are made of the state and the params of any plant.

    Raises RuntimeError if the compiler refuses.
    """

    def __init__(self, state, params) -> None:
        self._structs = Structs()
        numbers = motion.Rates, rigid_body.Inertia, motion.Decay
        for value in (state, params, *(one(*len(one._fields) * (0.0,)) for one in numbers)):
            self._structs.declare(value)
        with TemporaryDirectory() as folder:
            library = Path(folder) / 'floor.so'
            (Path(folder) / 'names.h').write_text(_constants() + '\n' + self._structs.text)
            done = subprocess.run(
                [compiler(), *FLAGS, '-shared', '-fPIC', '-I', folder, '-o', library]
                + [SOURCES / 'plant.c', '-lm'],
                capture_output=True,
                text=True,
            )
            if done.returncode:
                raise RuntimeError(f'{compiler()} does not compile the floor:\n{done.stderr}')
            self._library = ctypes.CDLL(str(library))

    def plant_steps(self, state, params, commands, waters, motions) -> None:
        """Fill ``motions`` (n, 13) as `plant_steps` does."""
        c_state, c_params = self._structs.make(state), self._structs.make(params)
        self._library.plant_steps(
            ctypes.byref(c_state),
            ctypes.byref(c_params),
            commands.ctypes,
            waters.ctypes,
            ctypes.c_int64(len(commands)),
            ctypes.c_double(TICK_S),
            motions.ctypes,
        )


def compare(engine: np.ndarray, in_c: np.ndarray) -> int:
    """Number of ticks of two motions, float64[ticks, 13], which have the same bits.

    Raises RuntimeError if they have not, naming the first difference.
    """
    differs = np.argwhere(engine.view(np.uint64) != in_c.view(np.uint64))
    if len(differs):
        tick, column = differs[0]
        raise RuntimeError(
            f'the floor is not the arithmetic of the plant, at tick {tick}, '
            f'{motion.Motion._fields[column]}: {float(engine[tick, column])!r} and '
            f'{float(in_c[tick, column])!r} in C'
        )
    return len(engine)


@kernel
def _plant_steps(plant, params, commands, waters, dt, motions):
    for row in range(len(commands)):
        command = Joints(commands[row, 0], commands[row, 1], commands[row, 2], commands[row, 3])
        water = Water(waters[row, 0], waters[row, 1], waters[row, 2])
        plant = plant_step(plant, command, water, params, dt)
        for i, value in enumerate(plant.motion):
            motions[row, i] = value


def plant_steps(plant, params, commands, waters, motions) -> None:
    """Fill ``motions`` (n, 13) with where the plant goes under commands and waters (n, 3)."""
    _plant_steps(plant, params, commands, waters, TICK_S, motions)


def flight_of(scenario: Scenario) -> tuple:
    """State and parameters of the plant, and the commands and waters (n, 3) of its flight."""
    state, params = mission_of(scenario)
    log = np.concatenate([block.copy() for block in fly_blocks(state, params)])
    commands = np.ascontiguousarray(log[:, COLUMNS['command']])
    waters = np.array([water_from_wire(row) for row in log[:, COLUMNS['current_velocity']]])
    return state.plant, params.plant, commands, waters


def cost_s(function: Callable, *arguments) -> float:
    """Processor time (s) of a call."""
    start = time.thread_time()
    function(*arguments)
    return time.thread_time() - start
