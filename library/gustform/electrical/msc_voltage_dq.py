"""Machine-side converter that imposes a voltage through a virtual admittance."""

from __future__ import annotations

import math

from gustform.control.virtual_impedance import VirtualAdmittance
from gustform.electrical.msc_dq import MachineSideDq
from gustform.language import Input, Parameter, Part, Variable


class MachineSideVoltageDq(MachineSideDq):
    """Averaged converter whose control imposes a voltage on the machine, with a loop on the stator current.

        d(rho)/dt = p omega_base (omega_r - omega)          rho: EMF ahead of the voltage V, electrical
        i* from the virtual admittance 1/(r_v + j omega L) between the EMF and V at -rho, followed by the current loop

    So the machine's own reactance stands between V and the EMF, as in phasors, and b_msc is the same; r_v damps the
    stator's swing at the electrical speed, which V on the bare stator would leave to its resistance. Frame: that of the
    rotor. pu: rating and voltage of the machine, base of the rotor speed.
    Source: see MachineSideDq and VirtualAdmittance; Lyu, Subotic, Gross 2022, eqs. (4a), (9); r_v: project notes.
    """

    r_v = Parameter("pu", "virtual resistance", default=0.05, min=0.0)

    virtual = Part(
        VirtualAdmittance,
        "virtual admittance",
        r=lambda self: self.r_v,
        x=lambda self: self.L,
        psi=lambda self: self.psi,
    )

    V = Input("pu", "magnitude of the voltage, base V_b", start=1.0)
    omega = Input("pu", "frequency of the voltage, base of the rotor speed", start=1.2)
    rho = Variable("rad", "angle of the EMF ahead of the voltage", start=0.2, min=-math.pi / 2, max=math.pi / 2)

    def equations(self) -> None:
        super().equations()
        virtual = self.virtual
        self.eq(self.der(self.rho), self.pole_pairs * self.omega_base * (self.omega_r - self.omega))
        self.connect(virtual.V, self.V)
        self.connect(virtual.rho, self.rho)
        self.connect(virtual.omega, self.omega_r)
        self.follow(virtual.i_d, virtual.i_q)
