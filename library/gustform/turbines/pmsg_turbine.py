"""Wind turbine with a permanent-magnet generator and a back-to-back converter."""

from __future__ import annotations

import math

from gustform.aero.closed_form_rotor import ClosedFormRotor
from gustform.aero.cp_solver import cp_solver, inside
from gustform.aero.rotor import Rotor
from gustform.control.converter_control import ConverterControl
from gustform.control.curtailment_schedule import CurtailmentSchedule, observer_table, pitch_table, speed_table
from gustform.control.dual_port import DualPort
from gustform.control.grid_following import GridFollowing
from gustform.control.operating_point import (
    DualPortGains,
    Limits,
    OperatingPoint,
    dual_port_gains,
    operating_point,
    power_at,
)
from gustform.control.pitch import HeldPitchDemand, PitchControl
from gustform.control.schedule import FixedPoint, OperatingSchedule
from gustform.conventions import NOMINAL_FREQUENCY, active_power, reactive_power
from gustform.electrical.dc_link import DcLink
from gustform.electrical.grid_side import GridSide
from gustform.electrical.gsc import GridSideConverter
from gustform.electrical.line import Line
from gustform.electrical.machine_side import MachineSide
from gustform.electrical.msc import MachineSideConverter
from gustform.electrical.parallel_units import ParallelUnits
from gustform.electrical.permanent_magnet import PermanentMagnetMachine
from gustform.electrical.pmsg import Pmsg
from gustform.electrical.transformer import Transformer
from gustform.electrical.transformer_dq import TransformerDq
from gustform.interfaces import AcPort
from gustform.language import Component, Input, Output, Parameter, Part, Variable, maximum, minimum
from gustform.mechanical.drive_train import DriveTrain
from gustform.mechanical.one_mass import OneMass
from gustform.turbines import stages


class PmsgTurbine(Component):
    """PMSG wind turbine with grid-forming control, or `aggregate` identical ones.

        wind -> rotor -- drive train -- PMSG -- MSC -- DC link -- GSC -- transformer -- line -- grid
                  ^ pitch control                  \\--- control ---/        ^ schedule: operating point

    Everything inside is one turbine; its currents are multiplied by `aggregate` at the grid port. pu: base `rating` of
    one turbine, `omega_base` for the rotor, `v_dc_base`, `voltage_converter` and `voltage` for the AC sides, f0. Signs:
    P_wt from the wind, P_pmsg from the machine into the MSC, P_gsc out of the GSC, P and Q delivered at the port.

    `omega_del`, `beta_del`, `K_msc` and `K_p` follow from the operating point at `wind_speed` with the control's
    `curtailment` unless they are given. Source: Lyu, Subotic, Gross 2022, with the project notes; see the parts.
    """

    fidelity = Parameter(
        "1",
        "lossless: the paper's analysis model; rms: phasors; dq: averaged filter, inner loops and stator",
        default="rms",
        structural=True,
        choices=("lossless", "rms", "dq"),
    )
    aggregate = Parameter("1", "number of identical turbines", default=1.0, min=1.0)
    rating = Parameter("VA", "rated power of one turbine, base of pu", default=5e6, above=0.0)
    voltage = Parameter("V", "nominal line-to-line RMS voltage at the grid port", default=33e3, above=0.0)
    voltage_converter = Parameter(
        "V", "nominal line-to-line RMS voltage of converter and machine", default=3.3e3, above=0.0
    )
    v_dc_base = Parameter("V", "nominal DC voltage", default=7920.0, above=0.0)
    omega_base = Parameter("1/s", "rotor speed that is 1 pu, rad/s", default=1.1417, above=0.0)
    f0 = Parameter("Hz", "nominal frequency", default=NOMINAL_FREQUENCY, above=0.0)
    r_line = Parameter("pu", "resistance of the line to the port, base rating and voltage", default=0.002, min=0.0)
    x_line = Parameter("pu", "reactance of the line to the port", default=0.04, above=0.0)

    wind_speed = Parameter("m/s", "wind speed of the operating point", default=8.0, above=0.0)
    curtailment = Parameter(
        "1", "share of the available power held back, 1 - eta; 0 is maximum power", default=0.0, min=0.0, max=0.95
    )
    omega_max = Parameter("pu", "highest operating speed", default=1.2, above=0.0)
    beta_min = Parameter("deg", "lowest pitch angle", default=0.0)
    cut_in = Parameter("m/s", "lowest wind speed of operation", default=3.0, above=0.0)
    cut_out = Parameter("m/s", "highest wind speed of operation", default=25.0, above=0.0)
    omega_del = Parameter(
        "pu", "rotor speed at the operating point", default=lambda self: self.operating_point().omega_del, above=0.0
    )
    beta_del = Parameter(
        "deg", "pitch angle at the operating point", default=lambda self: self.operating_point().beta_del
    )
    K_msc = Parameter("pu", "droop of the machine side", default=lambda self: self.gains().K_msc, min=0.0)
    K_p = Parameter("deg", "pitch for speed, deg/pu", default=lambda self: self.gains().K_p, min=0.0)
    Cp_max = Parameter(
        "1",
        "highest power coefficient at beta_min, of the available power",
        default=lambda self: self.cp_max(),
        above=0.0,
    )

    wind = Input("m/s", "rotor-effective wind speed", start=8.0, nominal=10.0)
    frame = Input("pu", "speed of the phasor frame, base f0", start=1.0)
    grid = AcPort(
        "grid port of all turbines",
        start={"vr": lambda self: self.voltage},
        nominal={"vr": lambda self: self.voltage, "vi": lambda self: self.voltage},
    )

    rotor = Part(ClosedFormRotor, "aerodynamics", base=Rotor)
    drive = Part(OneMass, "drive train", base=DriveTrain, w=lambda self: self.omega_del * self.omega_base)
    pmsg = Part(
        Pmsg,
        "generator",
        base=PermanentMagnetMachine,
        select=stages.machine,
        among=stages.MACHINES,
        rating=lambda self: self.rating,
        voltage=lambda self: self.voltage_converter,
        omega_base=lambda self: self.omega_base,
        stator_dynamics=lambda self: self.fidelity == "dq",
        i_q=lambda self: self.power_start() / (self.omega_del * self.pmsg.psi),
    )
    msc = Part(
        MachineSideConverter,
        "machine-side converter",
        base=MachineSide,
        select=stages.machine_side,
        among=stages.MACHINE_SIDES,
        rating=lambda self: self.rating,
        voltage=lambda self: self.voltage_converter,
        omega_base=lambda self: self.omega_base,
        pole_pairs=lambda self: self.pmsg.pole_pairs,
        psi=lambda self: self.pmsg.psi,
        L=lambda self: self.pmsg.L,
        r=lambda self: self.pmsg.r,
    )
    dc_link = Part(DcLink, "DC link", voltage=lambda self: self.v_dc_base)
    gsc = Part(
        GridSideConverter,
        "grid-side converter",
        base=GridSide,
        select=stages.grid_side,
        among=stages.GRID_SIDES,
        lossless=lambda self: self.fidelity == "lossless",
        rating=lambda self: self.rating,
        voltage=lambda self: self.voltage_converter,
        f0=lambda self: self.f0,
        i_fd=lambda self: self.power_start(),
    )
    transformer = Part(
        Transformer,
        "turbine transformer",
        base=Transformer,
        select=stages.transformer,
        among=(TransformerDq,),
        lossless=lambda self: self.fidelity == "lossless",
        f0=lambda self: self.f0,
        rating=lambda self: self.rating,
        voltage_primary=lambda self: self.voltage_converter,
        voltage_secondary=lambda self: self.voltage,
        x=0.06,
    )
    line = Part(
        Line,
        "line to the grid port",
        voltage=lambda self: self.voltage,
        R=lambda self: 0.0 if self.fidelity == "lossless" else self.r_line * self.voltage**2 / self.rating,
        X=lambda self: self.x_line * self.voltage**2 / self.rating,
    )
    units = Part(ParallelUnits, "turbines in parallel", n=lambda self: self.aggregate)
    control = Part(
        DualPort,
        "control of both converters",
        base=ConverterControl,
        among=(DualPort, GridFollowing),
        lossless=lambda self: self.fidelity == "lossless",
        curtailment=lambda self: self.curtailment,
        K_msc=lambda self: self.K_msc,
        k_opt=lambda self: self.power_start() / self.omega_del**3,
    )
    schedule = Part(
        FixedPoint,
        "where the operating point comes from",
        base=OperatingSchedule,
        among=(FixedPoint, CurtailmentSchedule),
        omega_point=lambda self: self.omega_del,
        beta_point=lambda self: self.beta_del - self.pitch_of_limiter(),
        wind_point=lambda self: self.wind_speed,
        sampled=lambda self: self.control.sampled,
        curtailment=lambda self: self.control.curtailment,
        omega_max=lambda self: self.omega_max,
        omega_table=lambda self: speed_table(self.rotor, self.limits()),
        beta_table=lambda self: pitch_table(self.rotor, self.limits()),
        cp=lambda self: observer_table(self.rotor),
        H=lambda self: self.drive.J * self.omega_base**2 / (2.0 * self.rating),
        v_tip=lambda self: self.rotor.radius * self.omega_base,
        v_one=lambda self: (self.rating / self.rotor.power_per_cube()) ** (1.0 / 3.0),
    )
    pitch = Part(
        PitchControl,
        "pitch control",
        select=lambda self: HeldPitchDemand if self.control.sampled > 0.0 else PitchControl,
        among=(HeldPitchDemand,),
        beta_start=lambda self: self.beta_del,
        K_p=lambda self: self.K_p,
        omega_max=lambda self: self.omega_max,
        beta_min=lambda self: self.beta_min,
        beta_limiter=lambda self: self.pitch_of_limiter(),
        P_filtered=lambda self: self.power_start(),
    )

    v_dc = Variable("pu", "DC voltage, base v_dc_base", start=1.0)
    dv_dc = Variable("1/s", "rate of change of the DC voltage in pu/s, base v_dc_base")
    omega_r = Variable("pu", "rotor speed, base omega_base", start=1.2)
    beta = Variable("deg", "pitch angle", nominal=10.0)
    frequency = Variable("Hz", "frequency of the GSC voltage", start=NOMINAL_FREQUENCY, nominal=NOMINAL_FREQUENCY)
    P_wt = Variable("pu", "power from the wind, base rating", start=lambda self: self.power_start())
    P_available = Variable("pu", "power that the wind offers at Cp_max, at most the rating, base rating", start=0.5)
    P_reserve = Variable("pu", "available power that is not taken, P_available - P_wt, base rating")
    P_pmsg = Variable("pu", "power from the machine into the MSC, base rating", start=0.5)
    P_gsc = Variable("pu", "active power out of the GSC, base rating", start=0.5)
    Q_gsc = Variable("pu", "reactive power out of the GSC, base rating")
    v_d = Variable("pu", "voltage at the grid side of the GSC's filter, along the GSC's frame", start=1.0)
    v_q = Variable("pu", "voltage at the grid side of the GSC's filter, across the GSC's frame")
    Q_msc = Variable("pu", "reactive power of the MSC into the machine, base rating")
    P = Variable("W", "active power of all turbines, delivered at the port", start=1e6, nominal=1e6)
    Q = Variable("var", "reactive power of all turbines, delivered at the port", nominal=1e6)
    omega_gsc = Output("pu", "frequency of the GSC voltage, base f0", start=1.0)
    tripped = Output("1", "1 after the DC voltage has collapsed: the converters are blocked")

    def limits(self) -> Limits:
        """What bounds the operation of this turbine."""
        return Limits(self.rating, self.omega_base, self.omega_max, self.beta_min, self.cut_in, self.cut_out)

    def operating_point(self) -> OperatingPoint:
        """Where this turbine works in a constant wind of `wind_speed`."""
        return operating_point(self.rotor, self.wind_speed, self.control.curtailment, self.limits())

    def power_start(self) -> float:
        """First guess of the power: that of the rotor at omega_del and beta_del, pu."""
        return power_at(self.rotor, self.wind_speed, self.omega_del, self.beta_del, self.limits())

    def cp_max(self) -> float:
        """The highest Cp at beta_min."""
        aero = cp_solver(self.rotor)
        beta = inside(float(self.beta_min), aero.pitches)
        return float(aero.value(aero.mpp(beta), beta))

    def gains(self) -> DualPortGains:
        """The largest gains of dual-port control that the operating point allows."""
        control = self.control
        if not isinstance(control, DualPort):
            return DualPortGains(0.0, 0.0, float("inf"))
        return dual_port_gains(self.operating_point(), control.K_gsc, control.frequency_reserve)

    def pitch_of_limiter(self) -> float:
        """What of beta_del the integral of the speed limiter gives at the start, deg; the schedule gives the rest."""
        if self.control.scheduled_pitch or not isinstance(self.schedule, FixedPoint):
            return 0.0
        return float(max(self.beta_del - self.beta_min, 0.0))

    def equations(self) -> None:
        rotor, drive, pmsg, msc, gsc = self.rotor, self.drive, self.pmsg, self.msc, self.gsc
        control, schedule, pitch = self.control, self.schedule, self.pitch
        # mechanics and power
        self.connect(rotor.wind, self.wind)
        self.connect(rotor.shaft, drive.rotor)
        self.connect(pmsg.shaft, drive.generator)
        self.connect(pmsg.terminal, msc.machine)
        self.connect(msc.dc, self.dc_link.machine)
        self.connect(gsc.dc, self.dc_link.grid)
        self.connect(gsc.grid, self.transformer.primary)
        self.connect(self.transformer.secondary, self.line.sending)
        self.connect(self.line.receiving, self.units.one)
        self.connect(self.units.all, self.grid)
        # measurements, pu
        self.eq(self.v_dc, self.dc_link.v / self.v_dc_base)
        self.eq(self.dv_dc, self.der(self.dc_link.v) / self.v_dc_base)
        self.eq(self.omega_r, drive.w / self.omega_base)
        self.eq(self.P_wt, rotor.P / self.rating)
        v = maximum(self.wind, rotor.wind_min)
        per_cube = 0.5 * math.pi * rotor.efficiency * rotor.density * rotor.radius * rotor.radius
        self.eq(self.P_available, minimum(per_cube * self.Cp_max * (v * v * v) / self.rating, 1.0))
        self.eq(self.P_reserve, self.P_available - self.P_wt)
        self.eq(self.P_pmsg, msc.P / self.rating)
        self.eq(self.P_gsc, gsc.P / self.rating)
        self.eq(self.Q_gsc, gsc.Q / self.rating)
        self.eq(self.Q_msc, msc.Q / self.rating)
        self.connect(self.v_d, gsc.v_d)
        self.connect(self.v_q, gsc.v_q)
        self.connect(self.tripped, self.dc_link.tripped)
        # operating point
        self.connect(schedule.wind, self.wind)
        self.connect(schedule.omega_r, self.omega_r)
        self.connect(schedule.beta, pitch.beta)
        self.connect(schedule.P, self.P_pmsg)
        # control: what it reads, by name; what it commands, by the name of the converter's input
        measured = {
            "v_dc": self.v_dc,
            "dv_dc": self.dv_dc,
            "omega_r": self.omega_r,
            "P_pmsg": self.P_pmsg,
            "P_gsc": self.P_gsc,
            "Q_gsc": self.Q_gsc,
            "Q_msc": self.Q_msc,
            "v_d": self.v_d,
            "v_q": self.v_q,
            "omega_del": schedule.omega_del,
            "beta_del": schedule.beta_del,
            "wind": self.wind,
            "blocked": self.tripped,
        }
        for name in control.declared(Input):
            self.connect(getattr(control, name), measured[name])
        for suffix, converter in (("gsc", gsc), ("msc", msc)):
            for name in converter.declared(Input):
                if name in measured:
                    self.connect(getattr(converter, name), measured[name])
                elif name != "frame":
                    self.connect(getattr(converter, name), getattr(control, f"{name.removesuffix('_ref')}_{suffix}"))
        if "frame" in pmsg.declared(Input):
            self.connect(pmsg.frame, control.omega_msc)
        self.connect(gsc.frame, self.frame)
        self.connect(pitch.omega_del, schedule.omega_del)
        self.connect(pitch.beta_del, schedule.beta_del)
        self.connect(pitch.omega_r, self.omega_r)
        self.connect(pitch.P, self.P_pmsg)
        self.connect(pitch.beta, rotor.beta)
        # what a user looks at
        self.connect(self.beta, pitch.beta)
        self.connect(self.omega_gsc, gsc.omega)
        self.eq(self.frequency, self.f0 * self.omega_gsc)
        self.eq(self.P, -active_power(self.grid))
        self.eq(self.Q, -reactive_power(self.grid))
