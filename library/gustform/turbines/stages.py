"""Which model of machine and converters a turbine has: by what the control imposes, and by fidelity."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from gustform.electrical.grid_side import GridSide
from gustform.electrical.gsc import GridSideConverter
from gustform.electrical.gsc_current import GridSideCurrent
from gustform.electrical.gsc_current_dq import GridSideCurrentDq
from gustform.electrical.gsc_voltage_dq import GridSideVoltageDq
from gustform.electrical.machine_side import MachineSide
from gustform.electrical.msc import MachineSideConverter
from gustform.electrical.msc_power import MachineSidePower
from gustform.electrical.msc_power_dq import MachineSidePowerDq
from gustform.electrical.msc_voltage_dq import MachineSideVoltageDq
from gustform.electrical.permanent_magnet import PermanentMagnetMachine
from gustform.electrical.pmsg import Pmsg
from gustform.electrical.pmsg_dq import PmsgDq
from gustform.electrical.transformer import Transformer
from gustform.electrical.transformer_dq import TransformerDq
from gustform.language import GustformError, Output

# What is imposed (the command that tells it) and the fidelity -> the model.
_GRID_SIDE: Mapping[tuple[str, str], type[GridSide]] = {
    ("V_gsc", "lossless"): GridSideConverter,
    ("V_gsc", "rms"): GridSideConverter,
    ("V_gsc", "dq"): GridSideVoltageDq,
    ("i_d_gsc", "lossless"): GridSideCurrent,
    ("i_d_gsc", "rms"): GridSideCurrent,
    ("i_d_gsc", "dq"): GridSideCurrentDq,
}
_MACHINE_SIDE: Mapping[tuple[str, str], type[MachineSide]] = {
    ("V_msc", "lossless"): MachineSideConverter,
    ("V_msc", "rms"): MachineSideConverter,
    ("V_msc", "dq"): MachineSideVoltageDq,
    ("P_msc", "lossless"): MachineSidePower,
    ("P_msc", "rms"): MachineSidePower,
    ("P_msc", "dq"): MachineSidePowerDq,
}
_MACHINE: Mapping[tuple[str, str], type[PermanentMagnetMachine]] = {
    ("V_msc", "lossless"): Pmsg,
    ("V_msc", "rms"): Pmsg,
    ("V_msc", "dq"): PmsgDq,
    ("P_msc", "lossless"): PmsgDq,
    ("P_msc", "rms"): PmsgDq,
    ("P_msc", "dq"): PmsgDq,
}

GRID_SIDES = tuple(_GRID_SIDE.values())
MACHINE_SIDES = tuple(_MACHINE_SIDE.values())
MACHINES = tuple(_MACHINE.values())


def grid_side(turbine: Any) -> type[GridSide]:
    """The grid-side converter of a turbine."""
    return _find(_GRID_SIDE, turbine)


def machine_side(turbine: Any) -> type[MachineSide]:
    """The machine-side converter of a turbine."""
    return _find(_MACHINE_SIDE, turbine)


def machine(turbine: Any) -> type[PermanentMagnetMachine]:
    """The generator of a turbine."""
    return _find(_MACHINE, turbine)


def transformer(turbine: Any) -> type[Transformer]:
    """The transformer of a turbine: with a current of its own where the converter's filter has a capacitor."""
    return TransformerDq if turbine.fidelity == "dq" else Transformer


def _find(models: Mapping[tuple[str, str], type[Any]], turbine: Any) -> type[Any]:
    commands = turbine.control.declared(Output)
    for (command, fidelity), kind in models.items():
        if command in commands and fidelity == turbine.fidelity:
            return kind
    raise GustformError(
        "GF1023",
        f"{type(turbine.control).__name__} cannot run at fidelity {turbine.fidelity}",
        hint="fidelity: rms",
    )
