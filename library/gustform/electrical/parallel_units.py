"""Many identical units seen as one."""

from __future__ import annotations

from gustform.interfaces import AcPort
from gustform.language import Component, Parameter


class ParallelUnits(Component):
    """n identical units in parallel, of which one is modelled: same voltage, n times the current.

        v_one = v_all,      i_all + n i_one = 0

    Ports: `one` towards the modelled unit, `all` towards the network. SI units; flows into this component.
    """

    n = Parameter("1", "number of units in parallel", default=1.0, min=1.0)

    one = AcPort("towards the one unit that is modelled")
    all = AcPort("towards the network")

    def equations(self) -> None:
        self.eq(self.one.vr, self.all.vr)
        self.eq(self.one.vi, self.all.vi)
        self.eq(self.all.ir + self.n * self.one.ir, 0)
        self.eq(self.all.ii + self.n * self.one.ii, 0)
