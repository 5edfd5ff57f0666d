"""The exported step on what a simulation measured: at 1 kHz its commands are those of the continuous control."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from gustform_cli.export import block_of_scenario
from gustform_cli.interrupt import Interrupt
from gustform_cli.simulate import simulate
from gustform_codegen.emit.controller.discretise import discretise
from gustform_codegen.emit.controller.program import program
from tests.support.controller import CONTROLS, Compiled

LOAD_STEP = Path(__file__).resolve().parents[3] / "cli" / "gustform_cli" / "scenarios" / "load_step_8ms.yaml"
STEP = 30.0  # s, of the load
PITCH = "beta_ref"
# Of nominal. Results are float, 3e-8 of a DC voltage; K_d_msc/T_dc = 101 at this operating point makes 3e-6 of it. An
# integral adds that up, because nothing closes the loop here: in 30 s of grid-following control, k_i = 20/s, 2e-5 of
# the DC voltage, and more of a reactive power that stands still.
AWAY = {"GridFollowing": 1e-4}
FAR = 1e-5
# The jump of the load falls between two samples, and Tustin's rule takes it for a ramp. After 0.25 s, five times the
# slowest filter, that is over.
NEAR, OVER = 1e-3, 0.25


SCHEDULES = {
    "": "",
    "measured": "{type: CurtailmentSchedule}",
    "estimated": "{type: CurtailmentSchedule, wind_source: estimated}",
}


@pytest.mark.parametrize(
    ("control", "schedule"), [*((c, "") for c in CONTROLS), ("DualPort", "measured"), ("DualPort", "estimated")]
)
def test_commands_are_those_of_the_continuous_control(control: str, schedule: str, tmp_path: Path) -> None:
    chosen = [f"components.wt.control={{type: {control}}}"]
    if schedule:
        chosen.append(f"components.wt.schedule={SCHEDULES[schedule]}")
    block = block_of_scenario("wt", LOAD_STEP, chosen)
    # What a part reads is a channel under the name of what it reads.
    at = {"omega_del": "wt.schedule.omega_del", "beta_del": "wt.schedule.beta_del"}
    inputs = [at.get(s.name, f"wt.{s.name}") for s in block.inputs]
    outputs = [f"wt.{'pitch' if s.name == PITCH else 'control'}.{s.name}" for s in block.outputs]
    channels = ", ".join(dict.fromkeys([*inputs, *outputs]))
    run = ["run.until=31 s", "run.rtol=1e-8", "output.every=1 ms", f"output.channels=[{channels}]"]
    with Interrupt() as interrupt:
        outcome = simulate(LOAD_STEP, tmp_path / "run", [*chosen, *run], interrupt, figure=False)
    assert outcome.error is None
    with xr.open_dataset(tmp_path / "run" / "result.nc", engine="h5netcdf") as data:
        time = data["time"].values
        names = {str(name) for name in data.data_vars}
        best = {name: name if name in names else name.replace("wt.control.", "wt.") for name in outputs}
        measured = np.column_stack([data[name].values for name in inputs]).astype(float)
        expected = np.column_stack([data[best[name]].values for name in outputs]).astype(float)
    compiled = Compiled(program(discretise(block, 1e-3)), tmp_path / "c", False)
    found, _, errors = compiled.run(measured)
    assert not errors.any()
    nominal = np.array([s.nominal for s in block.outputs])
    difference = np.abs(found - expected) / nominal
    near = (time > STEP - 0.002) & (time < STEP + OVER)
    assert float(difference[~near].max()) < AWAY.get(control, FAR)
    assert float(difference[near].max()) < NEAR
    assert (schedule != "") == ("omega_del" not in [s.name for s in block.inputs])
    moved = np.ptp(expected[time > STEP - 0.1], axis=0) / nominal
    assert moved.max() > 100 * FAR  # there is something to follow
