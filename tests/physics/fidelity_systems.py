"""The paper's test system in each fidelity, and what its tests ask of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gustform.control.converter_control import ConverterControl
from gustform.electrical.bus import Bus
from gustform.electrical.constant_power_load import ConstantPowerLoad
from gustform.electrical.synchronous_generator import SynchronousGenerator
from gustform.language.system import Constant, System
from gustform.turbines.pmsg_turbine import PmsgTurbine
from tests.reference import paper_rms as ref

Array = NDArray[np.float64]


def fidelity_system(
    fidelity: str, wind: float, curtailment: float = 0.1, control: ConverterControl | None = None
) -> System:
    """One 210 MVA generator, ten turbines as one, 100 MW + j5 Mvar, 20 MW more at 30 s; all in one fidelity."""
    given = {} if control is None else {"control": control}
    s = System()
    s.add("bus", Bus())
    s.add("sg", SynchronousGenerator(rating=ref.S_SG, fidelity=fidelity))
    s.add("wt", PmsgTurbine(aggregate=10, wind_speed=wind, curtailment=curtailment, fidelity=fidelity, **given))
    s.add("load", ConstantPowerLoad(active=ref.LOAD_P, reactive=ref.LOAD_Q))
    for port in ("sg.terminal", "wt.grid", "load.terminal"):
        s.connect(port, "bus.terminal")
    s.frame("sg.omega")
    s.bind("wt.wind", Constant(wind))
    s.change(ref.T_STEP, "load.active", ref.LOAD_P + ref.LOAD_STEP)
    return s
