"""An exported controller, compiled and loaded: its step over arrays of samples."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gustform.control.converter_control import ConverterControl
from gustform.control.curtailment_schedule import CurtailmentSchedule
from gustform.registry import PARTS
from gustform.turbines.pmsg_turbine import PmsgTurbine
from gustform_codegen.emit.controller.block import Block, controller_block
from gustform_codegen.emit.controller.discretise import Method, discretise
from gustform_codegen.emit.controller.folder import write_folder
from gustform_codegen.emit.controller.program import Program, program
from gustform_codegen.toolchain import find_compiler

DRIVER = Path(__file__).with_name("controller_driver.c")
CONTROLS = ["DualPort", "Droop", "GridFollowing", "Matching", "VirtualSynchronousMachine"]
# With a curtailment schedule: the wind measured, or observed, which has a state more and looks up a slope.
SCHEDULED = ["DualPort+measured", "GridFollowing+estimated"]
PREFIX = "ctl"
PERIOD = 1e-3

Array = NDArray[np.float64]
Bits = NDArray[np.uint32]


def block_of(control: str | ConverterControl) -> Block:
    """A control by its name or as it is, with the pitch control of the default turbine.

    "DualPort+measured": with a schedule whose wind is measured.
    """
    turbine, schedule = PmsgTurbine(), None
    if isinstance(control, str):
        name, _, source = control.partition("+")
        kind = PARTS[name].kind
        assert issubclass(kind, ConverterControl)
        control = kind()
        if source:
            turbine = PmsgTurbine(schedule=CurtailmentSchedule(wind_source=source))
            schedule = turbine.schedule
    return controller_block(control, turbine.pitch, None, schedule)


def program_of(control: str | ConverterControl, method: Method = Method.tustin, period: float = PERIOD) -> Program:
    return program(discretise(block_of(control), period, method))


class Compiled:
    """The C of a program as a shared library, in float or double."""

    def __init__(self, made: Program, folder: Path, double: bool) -> None:
        self.program, self.double = made, double
        self.type = np.float64 if double else np.float32
        write_folder(made, PREFIX, double, folder)
        library = folder / f"driver_{int(double)}.so"
        subprocess.run(
            [
                find_compiler().path, "-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared", f"-I{folder}",
                f"-DPREFIX={PREFIX}", f"-DUPPER={PREFIX.upper()}", f"-D{PREFIX.upper()}_DOUBLE={int(double)}",
                "-include", f"{PREFIX}.h", str(DRIVER), str(folder / f"{PREFIX}.c"), "-o", str(library), "-lm",
            ],
            check=True,
        )  # fmt: skip
        self.library = ctypes.CDLL(str(library))
        self.library.context_size.restype = ctypes.c_size_t

    def run(self, inputs: Array, parameters: Array | None = None) -> tuple[Array, Array, Bits]:
        """Outputs, memory and errors for inputs (samples, inputs) or (samples, instances, inputs)."""
        block = self.program.step.block
        shape = inputs.shape[:-1]
        instances = shape[1] if len(shape) == 2 else 1
        given = np.ascontiguousarray(inputs, self.type)
        out = np.zeros((*shape, len(block.outputs)), self.type)
        memory = np.zeros((*shape, len(block.states)), self.type)
        errors = np.zeros(shape, np.uint32)
        p = None if parameters is None else np.ascontiguousarray(parameters, self.type)
        self.calibration = self.library.drive(
            instances,
            shape[0],
            None if p is None else ctypes.c_void_p(p.ctypes.data),
            *(ctypes.c_void_p(a.ctypes.data) for a in (given, out, memory, errors)),
        )
        return out.astype(np.float64), memory.astype(np.float64), errors
