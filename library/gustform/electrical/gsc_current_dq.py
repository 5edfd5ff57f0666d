"""Grid-side converter that imposes the current of its LC filter."""

from __future__ import annotations

from gustform.electrical.gsc_dq import GridSideDq
from gustform.language import Input


class GridSideCurrentDq(GridSideDq):
    """Averaged converter with LC filter whose control imposes the current of the filter's inductor.

        i_f* = i_ref,   e from a PI loop on the current i_f

    The capacitor's own current comes on top: v b, about .05 pu ahead of the voltage. pu: rating, nominal voltage;
    currents out of the converter. Source: see GridSideDq and the loop; Lyu, Subotic, Gross 2022, III-A.
    """

    i_d_ref = Input("pu", "reference of the current along the frame, generator convention", start=0.5)
    i_q_ref = Input("pu", "reference of the current across the frame, generator convention")

    def equations(self) -> None:
        super().equations()
        self.follow(self.i_d_ref, self.i_q_ref)
