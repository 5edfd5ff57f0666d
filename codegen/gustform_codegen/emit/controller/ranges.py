"""What a measurement may be, and what a command may be: the limits of an exported controller's signals.

A sample outside its range is a fault of the sensor or of the bus, not a value to act on. A command is kept within its
range. pu as in ConverterControl.
"""

from __future__ import annotations

from collections.abc import Mapping

INPUT_RANGES: Mapping[str, tuple[float, float]] = {
    "v_dc": (0.0, 2.0),
    "dv_dc": (-1000.0, 1000.0),  # the full voltage within a sample of 1 ms
    "omega_r": (-0.1, 2.0),
    "omega_del": (0.0, 2.0),
    "beta_del": (-10.0, 90.0),
    "P_pmsg": (-3.0, 3.0),
    "P_gsc": (-3.0, 3.0),
    "Q_gsc": (-3.0, 3.0),
    "Q_msc": (-3.0, 3.0),
    "v_d": (-2.0, 2.0),
    "v_q": (-2.0, 2.0),
    "wind": (0.0, 100.0),
    "beta": (-10.0, 90.0),
}

OUTPUT_RANGES: Mapping[str, tuple[float, float]] = {
    "omega_gsc": (0.5, 1.5),
    "V_gsc": (0.0, 1.5),
    "i_d_gsc": (-2.0, 2.0),
    "i_q_gsc": (-2.0, 2.0),
    "omega_msc": (0.0, 2.0),
    "V_msc": (0.0, 1.5),
    "P_msc": (-1.5, 1.5),
    "beta_ref": (-10.0, 90.0),
}
