"""Phasor (RMS) reference of the paper's test system, written flat and by hand, sharing no code with gustform.

One 210 MVA synchronous generator, ten aggregated 5 MW PMSG turbines under dual-port grid-forming control, one
constant-power load, all on one bus; 20 MW load step.  X. Lyu, I. Subotic, D. Gross, "Unified Grid-Forming Control of
PMSG Wind Turbines for Fast Frequency Response and MPPT", IREP 2022, with the parameters "set A" of the project's notes.

Form: semi-explicit DAE, x' = f(x, z, wind, load), 0 = g(x, z, load), z = (vr, vi) of the bus, all else explicit.

Bases: turbine and its controls 50 MVA, rotor speed 1.1417 rad/s (nominal speed is therefore 1.2 pu), v_dc 7.92 kV;
generator, network and load 210 MVA; frequency 50 Hz.  Pitch in degrees, time in seconds.  Phasors: S = v conj(i),
P = vr ir + vi ii, Q = vi ir - vr ii.  The phasor frame turns with the generator's rotor: its angle delta is constant.

Choices, with their effect on the nadir at 8 m/s | 10 m/s in mHz (base 49.6416 | 49.6157 Hz; published 49.644 | 49.613):
  generator swing in power form 2H w dw/dt = Pm - Te, stator without speed voltages (Te is then the air-gap power)  base
    2H dw/dt = Pm - Te (w taken as 1)                                                                        +0.1 | +0.1
    2H dw/dt = Pm/w - Te with speed voltages in the stator (consistent, so equal)                            +0.1 | +0.1
    2H dw/dt = Pm/w - Te without speed voltages: INCONSISTENT, makes power from nothing; settles 6 mHz high  +9.9 | +9.9
  governor dead band on the speed deviation before the gain 1/R, continuous (deviation less 0.00105)                base
    same width after 1/R                                                                                      +49 | +46
    stepping (full deviation once outside)                                                                    +50 | +48
  Q_gsc measured at the converter terminals                                                                         base
    behind the filter                                                                                         0.0 | -0.1
    at the bus                                                                                               -0.1 | -0.2
  line resistance .002 left out                                                                              +0.1 | +0.3
  release time of the limiter integrators 5 ms ... 0.5 s                                                      0.0 |  0.0
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, root

Array = NDArray[np.float64]

# ---------------------------------------------------------------- parameters, set A
F0 = 50.0  # Hz
W0 = 2.0 * np.pi * F0  # rad/s
S_WT = 50e6  # VA, ten turbines
S_SG = 210e6  # VA
LOAD_P, LOAD_Q, LOAD_STEP = 100e6, 5e6, 20e6  # W, var, W
T_STEP, T_END = 30.0, 90.0  # s

# rotor: NREL 5 MW
RADIUS = 63.0  # m
OMEGA_BASE = 1.1417  # rad/s, 1 pu
OMEGA_MAX = 1.2  # pu
LAMBDA_MPP = 7.6857
CP_FIT = np.array(  # Cp/0.4897 = 1 + sum a_ij (lambda/LAMBDA_MPP - 1)^i (beta/10 deg)^j
    [
        [0.0, -0.041700792, -1.0116883, 0.25035167],
        [0.0, 1.1182009, -3.5208631, 1.1795875],
        [-1.2451227, 1.8222489, -0.87798351, -0.69166117],
        [2.3810225, -7.9564136, 14.522795, -10.36426],
        [-4.2319617, 15.024635, -23.185559, 7.5504531],
        [3.0500212, -10.000686, 12.020351, 0.30400836],
    ]
)
CP_RATIO_RANGE = (0.70, 1.56)  # of lambda/LAMBDA_MPP; clamped outside
CP_BETA_RANGE = (0.0, 12.0)  # deg; clamped outside
RHO_CP = 0.5663  # rho * efficiency * Cp_max, kg/m^3
POWER_PER_CUBE = 0.5 * np.pi * RADIUS**2 * RHO_CP / 5e6  # pu of 5 MW per (m/s)^3, at Cp_max
WIND_RATED = POWER_PER_CUBE ** (-1.0 / 3.0)  # 11.23 m/s

# drive train, PMSG, DC link
H_WT = 0.5 * 35.328e6 * OMEGA_BASE**2 / 5e6  # s, 4.605
POLE_PAIRS = 100
PSI = 1.0 / 1.2  # pu: E = PSI * omega_r
XS_NOM = 0.4  # pu at 1.2 pu speed: Xs = XS_NOM * omega_r / 1.2
TAU_DC = 31.88e-3 * 7920.0**2 / 5e6  # s, C V^2 / S = 0.400

# dual-port control
K_GSC, KD_GSC, T_DC = 0.5, 0.0067, 0.002
KQ_GSC, KQ_MSC, T_V = 0.02, 0.05, 0.05
V_GSC_REF, VDC_REF = 1.0, 1.0
DELTA_OMEGA_MAX = 0.01  # pu, for the gain tables

# pitch
KP_SPEED, KI_SPEED = 60.0, 12.0  # deg/pu, deg/pu/s
KP_POWER, KI_POWER, T_POWER, P_MAX = 1.0, 2.0, 0.5, 1.0
T_SERVO, RATE_SERVO = 0.3, 8.0  # s, deg/s
T_RELEASE = 0.05  # s, decay of a limiter integrator that reaches its lower end (see README)

# network
Z_FILTER = complex(0.01, 0.10)  # pu of 50 MVA
Z_GSC = Z_FILTER + 0.06j + complex(0.002, 0.04)  # filter + transformer + line, pu of 50 MVA
X_SG_TRAFO = 0.12  # pu of 210 MVA

# synchronous generator
H_SG = 6.0
XD, XQ, XD1, XQ1, XD2, XQ2, XL, RA = 1.81, 1.76, 0.30, 0.65, 0.23, 0.25, 0.15, 0.003
TD1, TQ1, TD2, TQ2 = 8.0, 1.0, 0.03, 0.07
T1, T2, T3, DROOP, DEAD_BAND, VALVE = 0.3, 2.2, 7.4, 0.05, 0.00105, (0.0, 1.0)
K_AVR, TA, TB, TE, V_SG_REF, EFD = 200.0, 1.0, 10.0, 0.05, 1.0, (0.0, 5.0)


# ---------------------------------------------------------------- aerodynamics and operating point
def power_coefficient(tip_speed_ratio: Any, pitch: Any, m: Any = np) -> Any:
    """Cp / Cp_max of tip speed ratio and pitch (deg), both clamped to the range of the fit; m: numpy or casadi."""
    x = m.fmin(m.fmax(tip_speed_ratio / LAMBDA_MPP, CP_RATIO_RANGE[0]), CP_RATIO_RANGE[1]) - 1.0
    b = m.fmin(m.fmax(pitch, CP_BETA_RANGE[0]), CP_BETA_RANGE[1]) / 10.0
    columns = [sum(float(CP_FIT[i, j]) * b**j for j in range(4)) for i in range(6)]
    cp = columns[5]
    for c in columns[4::-1]:
        cp = cp * x + c
    return 1.0 + cp


def wind_power(omega_r: Any, pitch: Any, wind: Any, m: Any = np) -> Any:
    """P_wt (pu of 50 MVA) of rotor speed (pu), pitch (deg), wind (m/s)."""
    tip_speed_ratio = RADIUS * OMEGA_BASE * omega_r / wind
    return POWER_PER_CUBE * power_coefficient(tip_speed_ratio, pitch, m) * wind**3


def _pitch_for(target: float, omega: float, wind: float) -> float:
    """Pitch (deg) at which the rotor gives the target power (pu); 0 where it gives no more than that without pitch."""
    if wind_power(omega, 0.0, wind) <= target * (1.0 + 1e-12):
        return 0.0
    # at high lambda a little pitch raises Cp, so the target may be met twice: take the upper root, on the falling side
    grid = np.linspace(*CP_BETA_RANGE, 1201)
    surplus = wind_power(omega, grid, wind) - target
    last = int(np.flatnonzero((surplus[:-1] > 0.0) & (surplus[1:] <= 0.0))[-1])
    return float(brentq(lambda b: wind_power(omega, b, wind) - target, grid[last], grid[last + 1], xtol=1e-14))


@dataclass(frozen=True)
class OperatingPoint:
    """Curtailed operating point and the gains that follow from it (pu of 50 MVA and 1.1417 rad/s, deg)."""

    wind: float
    eta: float
    omega_mpp: float
    omega_del: float
    beta_mpp: float
    beta_del: float
    power: float
    K_msc: float
    K_p: float
    K_wr: float
    K_beta: float
    m_p: float


def operating_point(wind: float, eta: float = 0.9) -> OperatingPoint:
    """Rotor speed first, pitch second (paper, IV-B); gains at their limits (V-B), slopes as secants to the MPP."""
    omega_mpp = min(LAMBDA_MPP * wind / RADIUS / OMEGA_BASE, OMEGA_MAX)
    target = eta * min(POWER_PER_CUBE * wind**3, 1.0)
    ratio = 1.0
    if eta < 1.0:
        ratio = brentq(lambda r: power_coefficient(r * LAMBDA_MPP, 0.0) - eta, 1.0, CP_RATIO_RANGE[1], xtol=1e-14)
    omega_del = min(ratio * LAMBDA_MPP * wind / RADIUS / OMEGA_BASE, OMEGA_MAX)
    beta_del = _pitch_for(target, omega_del, wind)
    K_wr = K_p = K_beta = 0.0
    if wind >= WIND_RATED:
        K_msc = 1.0  # prescribed by the paper, to keep the droop above 2 %
        K_p = K_GSC * beta_del / (K_msc * DELTA_OMEGA_MAX)
    elif omega_del > omega_mpp:
        reserve = omega_del - omega_mpp
        K_msc = K_GSC * reserve / DELTA_OMEGA_MAX
        K_p = beta_del / reserve
        K_wr = float(wind_power(omega_mpp, 0.0, wind) - wind_power(omega_del, 0.0, wind)) / reserve
    else:
        K_msc = K_GSC  # MPPT
    beta_mpp = _pitch_for(min(1.0, POWER_PER_CUBE * wind**3), omega_mpp, wind)
    if beta_del > beta_mpp:
        gain = wind_power(omega_del, beta_mpp, wind) - wind_power(omega_del, beta_del, wind)
        K_beta = float(gain) / (beta_del - beta_mpp)
    slope = K_wr + K_beta * K_p
    power = float(wind_power(omega_del, beta_del, wind))
    m_p = K_GSC / (K_msc * slope) if slope > 0.0 else np.inf
    return OperatingPoint(wind, eta, omega_mpp, omega_del, beta_mpp, beta_del, power, K_msc, K_p, K_wr, K_beta, m_p)


# ---------------------------------------------------------------- steady state
@dataclass(frozen=True)
class SteadyState:
    """Set points and start values.  Angles in rad against the bus, whose angle is 0; generator in pu of 210 MVA."""

    op: OperatingPoint
    turbine: bool
    v_bus: float
    theta_gsc: float
    Q_gsc: float
    rho: float  # theta_r - theta_msc
    V_msc: float
    delta: float
    Eq1: float
    Ed1: float
    psi1d: float
    psi2q: float
    P_m: float
    E_fd: float


def _q_gsc(v: complex, i: complex) -> float:
    return float((v * np.conj(i)).imag)


def steady_state(op: OperatingPoint, turbine: bool = True) -> SteadyState:
    """Load flow at 50 Hz with |V| = 1 at the GSC and at the generator's terminals; then every state from closed forms.

    turbine=False puts a constant-power source (Q = 0) in place of the turbine: the grid-following limit.
    """
    z_gsc = Z_GSC * S_SG / S_WT
    p_wt = op.power * S_WT / S_SG
    s_load = complex(LOAD_P, LOAD_Q) / S_SG

    def mismatch(u: Array) -> list[float]:
        v, theta, angle = u
        i_wt = (V_GSC_REF * np.exp(1j * theta) - v) / z_gsc if turbine else complex(p_wt / v)
        i_sg = (V_SG_REF * np.exp(1j * angle) - v) / (1j * X_SG_TRAFO)
        balance = i_wt + i_sg - np.conj(s_load / v)
        power = (V_GSC_REF * np.exp(1j * theta) * np.conj(i_wt)).real - p_wt if turbine else theta
        return [balance.real, balance.imag, power]

    solution = root(mismatch, [1.0, 0.1, 0.05], tol=1e-14)
    assert np.max(np.abs(mismatch(solution.x))) < 1e-12
    v, theta, angle = (float(u) for u in solution.x)

    e_gsc = V_GSC_REF * np.exp(1j * theta)
    Q_gsc = _q_gsc(e_gsc, (e_gsc - v) / z_gsc) * S_SG / S_WT if turbine else 0.0

    # machine side: P = E V sin(rho)/Xs and Q = 0, i.e. V = E cos(rho)
    E = PSI * op.omega_del
    X = XS_NOM * op.omega_del / 1.2
    rho = 0.5 * np.arcsin(2.0 * op.power * X / E**2)

    vt = V_SG_REF * np.exp(1j * angle)
    i = (vt - v) / (1j * X_SG_TRAFO)
    delta = float(np.angle(vt + complex(RA, XQ) * i))
    turn = np.exp(-1j * (delta - np.pi / 2))  # network -> (d + j q)
    vd, vq, i_d, i_q = (vt * turn).real, (vt * turn).imag, (i * turn).real, (i * turn).imag
    psi_d, psi_q = vq + RA * i_q, -(vd + RA * i_d)
    Eq1, Ed1 = psi_d + XD1 * i_d, (XQ - XQ1) * i_q
    return SteadyState(
        op=op,
        turbine=turbine,
        v_bus=v,
        theta_gsc=theta if turbine else 0.0,
        Q_gsc=Q_gsc,
        rho=float(rho),
        V_msc=float(E * np.cos(rho)),
        delta=delta,
        Eq1=float(Eq1),
        Ed1=float(Ed1),
        psi1d=float(Eq1 - (XD1 - XL) * i_d),
        psi2q=float(-Ed1 - (XQ1 - XL) * i_q),
        P_m=float(psi_d * i_q - psi_q * i_d),
        E_fd=float(Eq1 + (XD - XD1) * i_d),
    )


# ---------------------------------------------------------------- the DAE
@dataclass(frozen=True)
class FlatDae:
    """x' = ode(x, z, wind, load), 0 = alg(x, z, load) in CasADi SX; wind in m/s, load in W; x0, z0 steady."""

    start: SteadyState
    x_names: list[str]
    x: ca.SX
    z: ca.SX
    wind: ca.SX
    load: ca.SX
    ode: ca.SX
    alg: ca.SX
    x0: Array
    z0: Array
    outputs: dict[str, ca.SX]


def _clip(value: Any, low: float, high: float) -> Any:
    return ca.fmin(ca.fmax(value, low), high)


def flat_dae(start: SteadyState) -> FlatDae:
    """The whole system: 21 states (9 without the turbine) and the 2 parts of the bus voltage."""
    x: dict[str, ca.SX] = {}
    x0: dict[str, float] = {}
    der: dict[str, Any] = {}
    out: dict[str, Any] = {}

    def state(name: str, value: float) -> ca.SX:
        x[name], x0[name] = ca.SX.sym(name), value
        return x[name]

    vr, vi = ca.SX.sym("vr"), ca.SX.sym("vi")
    wind, load = ca.SX.sym("wind"), ca.SX.sym("load")
    op = start.op

    # ---- synchronous generator, pu of 210 MVA; currents leave the machine
    w = state("sg.w", 1.0)
    Eq1, Ed1 = state("sg.Eq1", start.Eq1), state("sg.Ed1", start.Ed1)
    psi1d, psi2q = state("sg.psi1d", start.psi1d), state("sg.psi2q", start.psi2q)
    valve, lag = state("gov.valve", start.P_m), state("gov.lag", start.P_m)
    lead, Efd = state("avr.lead", start.E_fd / K_AVR), state("avr.Efd", start.E_fd)
    # subtransient fluxes and stator, solved together with the transformer for i_d, i_q:
    #   psi_d = -XD2 i_d + psi2_d,  psi_q = -XQ2 i_q + psi2_q,  v_d = -RA i_d - psi_q,  v_q = -RA i_q + psi_d
    #   terminal = bus + j X_SG_TRAFO i:  v_d = b_d - X i_q,  v_q = b_q + X i_d
    psi2_d = (XD2 - XL) / (XD1 - XL) * Eq1 + (XD1 - XD2) / (XD1 - XL) * psi1d
    psi2_q = -(XQ2 - XL) / (XQ1 - XL) * Ed1 + (XQ1 - XQ2) / (XQ1 - XL) * psi2q
    sin_d, cos_d = np.sin(start.delta), np.cos(start.delta)
    b_d, b_q = vr * sin_d - vi * cos_d, vr * cos_d + vi * sin_d
    det = RA**2 + (XQ2 + X_SG_TRAFO) * (XD2 + X_SG_TRAFO)
    i_d = (-RA * (psi2_q + b_d) + (XQ2 + X_SG_TRAFO) * (psi2_d - b_q)) / det
    i_q = ((XD2 + X_SG_TRAFO) * (psi2_q + b_d) + RA * (psi2_d - b_q)) / det
    i_sg_r, i_sg_i = i_d * sin_d + i_q * cos_d, -i_d * cos_d + i_q * sin_d
    v_d, v_q = b_d - X_SG_TRAFO * i_q, b_q + X_SG_TRAFO * i_d
    V_t = ca.sqrt(v_d**2 + v_q**2)
    psi_d, psi_q = -XD2 * i_d + psi2_d, -XQ2 * i_q + psi2_q
    T_e = psi_d * i_q - psi_q * i_d
    P_m = lag + T2 / T3 * (valve - lag)
    der["sg.w"] = (P_m - T_e) / (2.0 * H_SG * w)
    sat_d = (XD1 - XD2) / (XD1 - XL) ** 2 * (psi1d + (XD1 - XL) * i_d - Eq1)
    sat_q = (XQ1 - XQ2) / (XQ1 - XL) ** 2 * (psi2q + (XQ1 - XL) * i_q + Ed1)
    der["sg.Eq1"] = (-Eq1 - (XD - XD1) * (i_d - sat_d) + Efd) / TD1
    der["sg.Ed1"] = (-Ed1 + (XQ - XQ1) * (i_q - sat_q)) / TQ1
    der["sg.psi1d"] = (-psi1d + Eq1 - (XD1 - XL) * i_d) / TD2
    der["sg.psi2q"] = (-psi2q - Ed1 - (XQ1 - XL) * i_q) / TQ2

    # ---- TGOV1 and SEXS
    deviation = w - 1.0
    outside = ca.fmax(deviation - DEAD_BAND, 0.0) + ca.fmin(deviation + DEAD_BAND, 0.0)
    der["gov.valve"] = (_clip(start.P_m - outside / DROOP, *VALVE) - valve) / T1
    der["gov.lag"] = (valve - lag) / T3
    error = V_SG_REF + start.E_fd / K_AVR - V_t
    der["avr.lead"] = (error - lead) / TB
    der["avr.Efd"] = (_clip(K_AVR * (lead + TA / TB * (error - lead)), *EFD) - Efd) / TE

    # ---- load, constant power
    v2 = vr**2 + vi**2
    p_load, q_load = load / S_SG, LOAD_Q / S_SG
    i_load_r, i_load_i = (p_load * vr + q_load * vi) / v2, (p_load * vi - q_load * vr) / v2
    out.update({"frequency": F0 * w, "P_m": P_m, "P_sg": v_d * i_d + v_q * i_q, "V_t": V_t, "V_bus": ca.sqrt(v2)})

    if start.turbine:
        # ---- rotor and PMSG, pu of 50 MVA; P_pmsg flows from the machine into the MSC, Q_msc out of the MSC
        omega_r = state("wt.omega_r", op.omega_del)
        rho = state("wt.rho", start.rho)
        v_dc = state("wt.v_dc", VDC_REF)
        xi_gsc, xi_msc = state("gsc.xi", 0.0), state("msc.xi", 0.0)
        theta = state("gsc.theta", start.theta_gsc)
        Qf_gsc, Qf_msc = state("gsc.Qf", start.Q_gsc), state("msc.Qf", 0.0)
        beta = state("pitch.beta", op.beta_del)
        Pf = state("pitch.Pf", op.power)
        I_speed, I_power = state("pitch.I_speed", 0.0), state("pitch.I_power", 0.0)

        P_wt = wind_power(omega_r, beta, wind, ca)
        E, X = PSI * omega_r, XS_NOM * omega_r / 1.2
        V_msc = start.V_msc + KQ_MSC * (0.0 - Qf_msc)
        P_pmsg = E * V_msc / X * ca.sin(rho)
        Q_msc = (V_msc**2 - E * V_msc * ca.cos(rho)) / X
        der["wt.omega_r"] = (P_wt - P_pmsg) / (2.0 * H_WT * omega_r)

        # ---- GSC: voltage behind its impedance; P_gsc, Q_gsc leave the converter
        z = Z_GSC * S_SG / S_WT
        V_gsc = V_GSC_REF + KQ_GSC * (start.Q_gsc - Qf_gsc)
        e_r, e_i = V_gsc * ca.cos(theta), V_gsc * ca.sin(theta)
        i_wt_r = ((e_r - vr) * z.real + (e_i - vi) * z.imag) / abs(z) ** 2
        i_wt_i = ((e_i - vi) * z.real - (e_r - vr) * z.imag) / abs(z) ** 2
        P_gsc = (e_r * i_wt_r + e_i * i_wt_i) * S_SG / S_WT
        Q_gsc = (e_i * i_wt_r - e_r * i_wt_i) * S_SG / S_WT
        der["wt.v_dc"] = (P_pmsg - P_gsc) / (TAU_DC * v_dc)

        # ---- dual-port control, both sides: (K + Kd s)/(T s + 1) as one state
        dv = v_dc - VDC_REF
        Kd_msc = KD_GSC * op.K_msc / K_GSC
        omega_gsc = 1.0 + K_GSC * xi_gsc + KD_GSC / T_DC * (dv - xi_gsc)
        omega_msc = op.omega_del + op.K_msc * xi_msc + Kd_msc / T_DC * (dv - xi_msc)
        der["gsc.xi"] = (dv - xi_gsc) / T_DC
        der["msc.xi"] = (dv - xi_msc) / T_DC
        der["gsc.theta"] = W0 * (omega_gsc - w)
        der["wt.rho"] = POLE_PAIRS * OMEGA_BASE * (omega_r - omega_msc)
        der["gsc.Qf"] = (Q_gsc - Qf_gsc) / T_V
        der["msc.Qf"] = (Q_msc - Qf_msc) / T_V

        # ---- pitch
        e_speed, e_power = omega_r - OMEGA_MAX, Pf - P_MAX
        der["pitch.Pf"] = (P_pmsg - Pf) / T_POWER
        der["pitch.I_speed"] = ca.fmax(KI_SPEED * e_speed, -I_speed / T_RELEASE)
        der["pitch.I_power"] = ca.fmax(KI_POWER * e_power, -I_power / T_RELEASE)
        u_speed = ca.fmax(KP_SPEED * e_speed + I_speed, 0.0)
        u_power = ca.fmax(KP_POWER * e_power + I_power, 0.0)
        beta_free = op.beta_del + op.K_p * (omega_r - op.omega_del) + u_speed + u_power
        beta_ref = ca.fmax(beta_free, 0.0)
        rate = (beta_ref - beta) / T_SERVO
        der["pitch.beta"] = _clip(rate, -RATE_SERVO, RATE_SERVO)
        out.update(
            {
                "omega_r": omega_r, "v_dc": v_dc, "beta": beta, "P_wt": P_wt, "P_pmsg": P_pmsg, "P_gsc": P_gsc,
                "Q_gsc": Q_gsc, "Q_msc": Q_msc, "V_msc": V_msc, "frequency_gsc": F0 * omega_gsc, "omega_msc": omega_msc,
                "beta_free": beta_free, "rate_free": rate, "u_speed": u_speed, "u_power": u_power,
                "lambda_ratio": RADIUS * OMEGA_BASE * omega_r / wind / LAMBDA_MPP, "E_fd": Efd,
            }
        )  # fmt: skip
    else:
        p_wt = op.power * S_WT / S_SG
        i_wt_r, i_wt_i = p_wt * vr / v2, p_wt * vi / v2

    names = list(x)
    return FlatDae(
        start=start,
        x_names=names,
        x=ca.vertcat(*x.values()),
        z=ca.vertcat(vr, vi),
        wind=wind,
        load=load,
        ode=ca.vertcat(*(der[n] for n in names)),
        alg=ca.vertcat(i_sg_r + i_wt_r - i_load_r, i_sg_i + i_wt_i - i_load_i),
        x0=np.array([x0[n] for n in names]),
        z0=np.array([start.v_bus, 0.0]),
        outputs=out,
    )


def residual_functions(dae: FlatDae) -> tuple[ca.Function, ca.Function]:
    """F(y, y', wind, load) = [x' - ode; alg] and J(y, y', wind, load, c) = F_y + c F_y', y = (x, z); for C code."""
    y = ca.vertcat(dae.x, dae.z)
    yp, c = ca.SX.sym("yp", y.numel()), ca.SX.sym("c")
    F = ca.vertcat(yp[: dae.x.numel()] - dae.ode, dae.alg)
    J = ca.jacobian(F, y) + c * ca.jacobian(F, yp)
    return (
        ca.Function("residual", [y, yp, dae.wind, dae.load], [F]),
        ca.Function("jacobian", [y, yp, dae.wind, dae.load, c], [J]),
    )


# ---------------------------------------------------------------- integration
@dataclass(frozen=True)
class Trajectory:
    """Time (s), states (one row a sample) and the outputs by name."""

    time: Array
    states: Array
    outputs: dict[str, Array]
    evaluations: int

    def __getitem__(self, name: str) -> Array:
        return self.outputs[name]


class Explicit:
    """The DAE as x' = f(x, z(x)): z by Newton to round-off, Jacobian f_x - f_z g_z^-1 g_x."""

    def __init__(self, dae: FlatDae) -> None:
        self.dae = dae
        a = [dae.x, dae.z, dae.wind, dae.load]
        g_z = ca.jacobian(dae.alg, dae.z)
        dz = -ca.solve(g_z, ca.jacobian(dae.alg, dae.x))
        J = ca.jacobian(dae.ode, dae.x) + ca.jacobian(dae.ode, dae.z) @ dz
        self._step = ca.Function("step", a, [dae.z - ca.solve(g_z, dae.alg)])
        self._ode = ca.Function("ode", a, [dae.ode])
        self._jac = ca.Function("slope", a, [J])
        self._out = ca.Function("out", a, list(dae.outputs.values()))
        self._z = dae.z0.copy()

    def z(self, x: Array, wind: float, load: float) -> Array:
        """Bus voltage that balances the currents."""
        z = self._z
        for _ in range(20):
            previous, z = z, np.asarray(self._step(x, z, wind, load)).ravel()
            if np.max(np.abs(z - previous)) < 1e-14:
                break
        self._z = z
        return z

    def ode(self, x: Array, wind: float, load: float) -> Array:
        """x'."""
        return np.asarray(self._ode(x, self.z(x, wind, load), wind, load)).ravel()

    def jacobian(self, x: Array, wind: float, load: float) -> Array:
        """d x' / d x."""
        return np.asarray(self._jac(x, self.z(x, wind, load), wind, load))

    def outputs(self, x: Array, wind: float, load: float) -> Array:
        """Outputs in the order of dae.outputs."""
        return np.array([float(v) for v in self._out(x, self.z(x, wind, load), wind, load)])


def integrate(
    dae: FlatDae, x0: Array, t0: float, t1: float, wind: Any, load: float, dt: float = 0.01,
    rtol: float = 1e-8, atol: float = 1e-10, max_step: float = np.inf,
) -> Trajectory:  # fmt: skip
    """scipy Radau from t0 to t1; wind a number or a function of time."""
    ex = Explicit(dae)
    at = wind if callable(wind) else lambda _t: wind
    time = np.linspace(t0, t1, round((t1 - t0) / dt) + 1)
    s = solve_ivp(
        lambda t, x: ex.ode(x, at(t), load), (t0, t1), x0, "Radau", time, rtol=rtol, atol=atol, max_step=max_step,
        jac=lambda t, x: ex.jacobian(x, at(t), load),
    )  # fmt: skip
    if not s.success:
        raise RuntimeError(s.message)
    rows = np.array([ex.outputs(x, at(t), load) for t, x in zip(time, s.y.T, strict=True)])
    return Trajectory(time, s.y.T, {n: rows[:, k] for k, n in enumerate(dae.outputs)}, int(s.nfev))


def integrate_idas(
    dae: FlatDae, x0: Array, t0: float, t1: float, wind: float, load: float, dt: float = 0.01,
    rtol: float = 1e-8, atol: float = 1e-10,
) -> Trajectory:  # fmt: skip
    """CasADi idas on the DAE itself: the second, independent integrator."""
    ex = Explicit(dae)
    time = np.linspace(t0, t1, round((t1 - t0) / dt) + 1)
    problem = {"x": dae.x, "z": dae.z, "p": ca.vertcat(dae.wind, dae.load), "ode": dae.ode, "alg": dae.alg}
    options = {"reltol": rtol, "abstol": atol, "max_num_steps": 1000000, "calc_ic": False}
    solver = ca.integrator("reference", "idas", problem, t0, time, options)
    s = solver(x0=x0, z0=ex.z(x0, wind, load), p=[wind, load])
    states = np.asarray(s["xf"]).T
    rows = np.array([ex.outputs(x, wind, load) for x in states])
    return Trajectory(time, states, {n: rows[:, k] for k, n in enumerate(dae.outputs)}, 0)


def load_step(
    wind: float = 8.0, eta: float = 0.9, turbine: bool = True, rtol: float = 1e-8, method: Any = integrate
) -> Trajectory:
    """Steady state to T_STEP, then LOAD_STEP more load, to T_END.  eta = 1 is GFM MPPT, turbine=False the GFL limit."""
    dae = flat_dae(steady_state(operating_point(wind, eta), turbine))
    a = method(dae, dae.x0, 0.0, T_STEP, wind, LOAD_P, rtol=rtol)
    b = method(dae, a.states[-1], T_STEP, T_END, wind, LOAD_P + LOAD_STEP, rtol=rtol)
    outputs = {n: np.concatenate([a[n][:-1], b[n]]) for n in a.outputs}
    return Trajectory(
        np.concatenate([a.time[:-1], b.time]), np.concatenate([a.states[:-1], b.states]), outputs,
        a.evaluations + b.evaluations,
    )  # fmt: skip


def frequency_figures(run: Trajectory) -> dict[str, float]:
    """Nadir, settling 60 s after the step, slope over the first 0.1 s, largest deviation before the step."""
    t, f = run.time, run["frequency"]
    after = t >= T_STEP
    i = int(np.argmin(f))
    slope = (np.interp(T_STEP + 0.1, t, f) - np.interp(T_STEP, t, f)) / 0.1
    return {
        "nadir_hz": float(f[i]), "nadir_time_s": float(t[i]), "settle_hz": float(f[after][-1]),
        "rocof_hz_per_s": float(slope), "held_hz": float(np.max(np.abs(f[~after] - F0))),
    }  # fmt: skip


# ---------------------------------------------------------------- turbulent wind
def rotor_effective_wind(mean: float = 10.0, duration: float = 600.0, dt: float = 0.05, seed: int = 1) -> Array:
    """Kaimal, IEC class B, L = 8.1 * 42 m, random amplitudes and phases, through the rotor-effective filter; m/s."""
    n = round(duration / dt)
    f = np.fft.rfftfreq(n, dt)[1:]
    sigma = 0.14 * (0.75 * mean + 5.6)
    length = 8.1 * 42.0
    spectrum = sigma**2 * 4.0 * length / mean / (1.0 + 6.0 * f * length / mean) ** (5.0 / 3.0)  # m^2/s^2/Hz, one-sided
    s = 2j * np.pi * f
    a, b = 0.55, 1.3 * RADIUS / mean
    H = (np.sqrt(2.0) + b * s) / ((np.sqrt(2.0) + b * np.sqrt(a) * s) * (1.0 + b * s / np.sqrt(a)))
    rng = np.random.default_rng(seed)
    noise = (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size)) / np.sqrt(2.0)
    amplitude = np.sqrt(spectrum / (2.0 * duration)) * noise * H * n
    amplitude[-1] = amplitude[-1].real
    series = np.fft.irfft(np.concatenate([[0.0], amplitude]), n)
    return np.asarray(np.append(mean + series, mean + series[0]))
