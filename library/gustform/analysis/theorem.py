"""The small-signal model of one generator and one dual-port turbine, and the theorem on its stability.

    T dx/dt = A x          x = (rho_gsc, rho_msc, omega_g, omega_r, v_dc, P_g), deviations

    d(rho_gsc)/dt   = omega_gsc - omega_g          omega_gsc = K_gsc v + K_d_gsc dv/dt
    d(rho_msc)/dt   = omega_msc - omega_r          omega_msc = K_msc v + K_d_msc dv/dt
    J_g d(omega_g)/dt = P_g + b_gsc rho_gsc        generator; b_gsc rho_gsc = P_gsc into the grid
    J_r d(omega_r)/dt = -K_wt omega_r + b_msc rho_msc      rotor; -b_msc rho_msc = P_pmsg
    C d(v)/dt       = -b_gsc rho_gsc - b_msc rho_msc
    T_g d(P_g)/dt   = -k_g omega_g - P_g           turbine and governor of the generator

    A = [ -K_d/C 1 1' B   -I      K_theta 1   0  ]     T = diag(1, 1, J_g, J_r, C, T_g)
        [  B              -K_wt   0           e1 ]     B = diag(b_gsc, b_msc),  K_wt = diag(0, K_wr + K_beta K_p)
        [ -1' B            0      0           0  ]
        [  0              -k_g e1'  0        -1  ]

Theorem: with K_wt >= 0 and K_d_gsc/K_gsc = K_d_msc/K_msc the origin is asymptotically stable, because in
x_B = (B rho, omega, v, P_g) the function V = x_B' M x_B falls by x_B' W x_B:

    M = 1/2 diag((K_theta B)^-1, K_theta^-1 J, C, T_g/(K_gsc k_g)),     dV/dt = -x_B' W x_B
    W = diag(K_d_gsc/(K_gsc C) 1 1',  (0, K_wt/K_msc),  0,  1/(K_gsc k_g))

The theorem has no filter in the controls. With one, T_dc d(xi)/dt = v - xi, the controls have xi for v and d(xi)/dt for
dv/dt: a seventh state. Then T_dc < K_d/K_theta is needed: with the grid held still the characteristic equation of one
side is C T_dc s^3 + C s^2 + b K_d s + b K_theta = 0.

Per unit of the turbine (aggregated units together); omega_g in pu of f0, omega_r in pu of the rotor's base. An angle
is divided by the base of its own speed (2 pi f0, pole pairs times omega_base), so it is in pu s and b in pu/(pu s).
J_g = 2 H_g S_g/S_wt and J_r = 2 H_wt omega_del, s; C is the time constant of the DC link, s; K_theta pu; K_d s.
Source: Lyu, Subotic, Gross 2022, V-A, eq. (14), theorem 1, corrected as in the project notes: row 4 has -k_g under
omega_g, e_2 is e_1, k_theta is K_theta, K_g is k_g, x_B holds both frequencies.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gustform.control.dual_port import DualPort
from gustform.electrical.first_order_governor import FirstOrderGovernor
from gustform.electrical.synchronous_generator import SynchronousGenerator
from gustform.language.errors import GustformError
from gustform.turbines.pmsg_turbine import PmsgTurbine

Array = NDArray[np.float64]

STATES = ("rho_gsc", "rho_msc", "omega_g", "omega_r", "v_dc", "P_g")
_SAME_RATIO = 1e-9  # relative difference at which the two ratios K_d/K_theta still count as equal


@dataclass(frozen=True, eq=False)
class SmallSignal:
    """Parameters of the model, each a number or an array; arrays of one shape make that many models."""

    J_g: float | Array
    J_r: float | Array
    C: float | Array
    T_g: float | Array
    k_g: float | Array
    b_gsc: float | Array
    b_msc: float | Array
    K_gsc: float | Array
    K_msc: float | Array
    K_d_gsc: float | Array
    K_d_msc: float | Array
    K_wt: float | Array

    def stacked(self) -> dict[str, Array]:
        """The parameters by name, all of one shape."""
        names = [f.name for f in fields(self)]
        values = np.broadcast_arrays(*[np.asarray(getattr(self, name), dtype=np.float64) for name in names])
        return dict(zip(names, values, strict=True))


@dataclass(frozen=True)
class Condition:
    """One condition by name, whether it holds, and its numbers."""

    name: str
    holds: bool
    detail: str


def matrices(p: SmallSignal) -> tuple[Array, Array]:
    """The diagonal of T (..., 6) and A (..., 6, 6)."""
    q = p.stacked()
    shape = q["C"].shape
    T = np.stack([np.ones(shape), np.ones(shape), q["J_g"], q["J_r"], q["C"], q["T_g"]], axis=-1)
    A = np.zeros((*shape, 6, 6))
    for row, K_d, K in ((0, q["K_d_gsc"], q["K_gsc"]), (1, q["K_d_msc"], q["K_msc"])):
        A[..., row, 0] = -K_d / q["C"] * q["b_gsc"]
        A[..., row, 1] = -K_d / q["C"] * q["b_msc"]
        A[..., row, 2 + row] = -1.0
        A[..., row, 4] = K
    A[..., 2, 0], A[..., 2, 5] = q["b_gsc"], 1.0
    A[..., 3, 1], A[..., 3, 3] = q["b_msc"], -q["K_wt"]
    A[..., 4, 0], A[..., 4, 1] = -q["b_gsc"], -q["b_msc"]
    A[..., 5, 2], A[..., 5, 5] = -q["k_g"], -1.0
    return T, A


def dynamics(p: SmallSignal, T_dc: float | Array = 0.0) -> Array:
    """T^-1 A, (..., 6, 6); with a filter, T_dc all > 0, the seventh state is xi, (..., 7, 7)."""
    T, A = matrices(p)
    plain = A / T[..., :, None]
    if not np.any(T_dc):
        return plain
    q = p.stacked()
    shape = np.broadcast_shapes(plain.shape[:-2], np.shape(T_dc))
    T_f = np.broadcast_to(np.asarray(T_dc, dtype=np.float64), shape)
    result = np.zeros((*shape, 7, 7))
    result[..., :6, :6] = plain
    for row, K_d, K in ((0, q["K_d_gsc"], q["K_gsc"]), (1, q["K_d_msc"], q["K_msc"])):
        result[..., row, :2] = 0.0
        result[..., row, 4] = K_d / T_f
        result[..., row, 6] = K - K_d / T_f
    result[..., 6, 4], result[..., 6, 6] = 1.0 / T_f, -1.0 / T_f
    return result


def lyapunov(p: SmallSignal) -> tuple[Array, Array]:
    """The diagonal of M (..., 6) and W (..., 6, 6), in the coordinates x_B = (B rho, omega, v, P_g)."""
    q = p.stacked()
    M = 0.5 * np.stack(
        [
            1.0 / (q["K_gsc"] * q["b_gsc"]),
            1.0 / (q["K_msc"] * q["b_msc"]),
            q["J_g"] / q["K_gsc"],
            q["J_r"] / q["K_msc"],
            q["C"],
            q["T_g"] / (q["K_gsc"] * q["k_g"]),
        ],
        axis=-1,
    )
    W = np.zeros((*M.shape, 6))
    W[..., :2, :2] = (q["K_d_gsc"] / (q["K_gsc"] * q["C"]))[..., None, None]
    W[..., 3, 3] = q["K_wt"] / q["K_msc"]
    W[..., 5, 5] = 1.0 / (q["K_gsc"] * q["k_g"])
    return M, W


def identity_error(p: SmallSignal, x_B: Array) -> Array:
    """|dV/dt + x_B' W x_B| over the sum of the sizes of all terms of dV/dt, at states x_B (..., 6)."""
    M, W = lyapunov(p)
    q = p.stacked()
    to_B = np.ones(M.shape)
    to_B[..., 0], to_B[..., 1] = q["b_gsc"], q["b_msc"]
    A_B = dynamics(p) * to_B[..., :, None] / to_B[..., None, :]
    terms = 2.0 * (M * x_B)[..., :, None] * A_B * x_B[..., None, :]
    fall = np.einsum("...i,...ij,...j->...", x_B, W, x_B)
    return np.asarray(np.abs(terms.sum(axis=(-2, -1)) + fall) / np.abs(terms).sum(axis=(-2, -1)))


def eigenvalues(p: SmallSignal, T_dc: float | Array = 0.0) -> NDArray[np.complex128]:
    """Eigenvalues, 1/s, of all models at once; (..., 6), with a filter (..., 7).

    Computed in the coordinates M^(1/2) x_B, in which the matrix without a filter is skew-symmetric but for what damps:
    round-off is then of the size of the machine's times the largest eigenvalue.
    """
    q = p.stacked()
    k_g = np.where(q["k_g"] > 0.0, q["k_g"], 1.0)  # only a scale here
    scale = np.sqrt(
        np.stack(
            [
                q["b_gsc"] / q["K_gsc"], q["b_msc"] / q["K_msc"], q["J_g"] / q["K_gsc"], q["J_r"] / q["K_msc"],
                q["C"], q["T_g"] / (q["K_gsc"] * k_g), q["C"],
            ],
            axis=-1,
        )
    )  # fmt: skip
    system = dynamics(p, T_dc)
    scale = scale[..., : system.shape[-1]]
    values: NDArray[np.complex128] = np.linalg.eigvals(system * scale[..., :, None] / scale[..., None, :]).astype(
        complex
    )
    return values


def conditions(p: SmallSignal) -> list[Condition]:
    """What the theorem asks for, for one model."""
    q = {name: float(value) for name, value in p.stacked().items()}
    positive = [n for n in q if n not in ("K_wt", "K_d_gsc", "K_d_msc") and not q[n] > 0.0]
    positive += [n for n in ("K_d_gsc", "K_d_msc") if not q[n] >= 0.0]
    ratio = [q["K_d_gsc"] / q["K_gsc"], q["K_d_msc"] / q["K_msc"]]
    return [
        Condition(
            "positive parameters",
            not positive,
            f"not so: {', '.join(positive)}" if positive else "inertias, time constants, susceptances and droops",
        ),
        Condition("K_wr + K_beta K_p >= 0", q["K_wt"] >= 0.0, f"{q['K_wt']:.4g} pu"),
        Condition(
            "K_d_gsc/K_gsc = K_d_msc/K_msc",
            math.isclose(ratio[0], ratio[1], rel_tol=_SAME_RATIO),
            f"{ratio[0]:.6g} s and {ratio[1]:.6g} s",
        ),
    ]


def filter_condition(p: SmallSignal, T_dc: float) -> Condition:
    """T_dc < K_d/K_theta, on the side where it is tighter: what a filter in the controls must keep to."""
    q = {name: float(value) for name, value in p.stacked().items()}
    limit = min(q["K_d_gsc"] / q["K_gsc"], q["K_d_msc"] / q["K_msc"])
    return Condition("T_dc < K_d/K_theta", T_dc < limit, f"{T_dc:g} s, limit {limit:.4g} s")


def random_sets(count: int, rng: np.random.Generator) -> SmallSignal:
    """Parameter sets that meet the theorem's conditions, even over orders of magnitude; a tenth has K_wt = 0."""

    def spread(low: float, high: float) -> Array:
        return np.asarray(np.exp(rng.uniform(math.log(low), math.log(high), count)))

    K_gsc, K_msc, K_d_gsc = spread(0.05, 5.0), spread(0.05, 50.0), spread(1e-4, 0.1)
    return SmallSignal(
        J_g=spread(2.0, 200.0),
        J_r=spread(1.0, 50.0),
        C=spread(0.02, 2.0),
        T_g=spread(0.1, 20.0),
        k_g=spread(1.0, 500.0),
        b_gsc=spread(300.0, 6000.0),
        b_msc=spread(30.0, 2000.0),
        K_gsc=K_gsc,
        K_msc=K_msc,
        K_d_gsc=K_d_gsc,
        K_d_msc=K_d_gsc * K_msc / K_gsc,
        K_wt=np.where(rng.uniform(size=count) < 0.1, 0.0, spread(1e-3, 5.0)),
    )


def power_slope(turbine: PmsgTurbine) -> tuple[float, float]:
    """-dP_wt/d(omega_r), pu/pu, and -dP_wt/d(beta), pu/deg: tangents at the turbine's operating point."""
    rotor, wind = turbine.rotor, float(turbine.wind_speed)
    omega, beta = ca.SX.sym("omega"), ca.SX.sym("beta")
    ratio = rotor.radius * turbine.omega_base * omega / wind
    low, high = rotor.tip_speed_ratio_range()
    power = rotor.power_per_cube() * wind**3 / turbine.rating * rotor.power_coefficient()(ratio, beta)
    slope = ca.Function("slope", [omega, beta], [ca.gradient(power, omega), ca.gradient(power, beta)])
    if not low < rotor.radius * turbine.omega_base * turbine.omega_del / wind < high:
        return 0.0, 0.0  # the rotor holds Cp constant beyond the range it is known for
    dw, db = slope(turbine.omega_del, turbine.beta_del)
    return -float(dw), -float(db)


def of_components(turbine: PmsgTurbine, generator: SynchronousGenerator) -> SmallSignal:
    """The model of a turbine with dual-port control at its operating point beside a generator.

    b_gsc: from the GSC's voltage to the voltage behind the generator's transient reactance, all voltages 1 pu and no
    angle between them, as in the paper. b_msc: slope of the machine's power over its angle where Q_msc = 0, with
    sin(2 rho) = 2 P L/psi^2 and V_msc = psi omega cos(rho): psi^2/L cos(rho)^2. K_wt: tangents at the operating point.
    T_g: T1 + T3 - T2 for TGOV1, its mean delay; k_g = 1/R. GF2050 for another control.
    """
    control = turbine.control
    if not isinstance(control, DualPort):
        raise GustformError(
            "GF2050",
            f"the small-signal model needs dual-port control; this turbine has {type(control).__name__}",
            hint="control: {type: DualPort}",
        )
    S_wt = float(turbine.rating * turbine.aggregate)
    S_g = float(generator.rating * generator.aggregate)
    governor: Any = generator.governor
    T_g = governor.T if isinstance(governor, FirstOrderGovernor) else governor.T1 + governor.T3 - governor.T2
    x = turbine.gsc.x + turbine.transformer.x + turbine.x_line
    x += (generator.transformer.x + generator.machine.xd1) * S_wt / S_g
    pmsg: Any = turbine.pmsg
    omega_del = float(turbine.omega_del)
    sine = 2.0 * turbine.power_start() * pmsg.L / (pmsg.psi**2 * omega_del)
    rho = 0.5 * math.asin(min(sine, 1.0))
    K_wr, K_beta = power_slope(turbine)
    return SmallSignal(
        J_g=2.0 * generator.machine.H * S_g / S_wt,
        J_r=turbine.drive.J * turbine.omega_base**2 / turbine.rating * omega_del,
        C=turbine.dc_link.C * turbine.v_dc_base**2 / turbine.rating,
        T_g=float(T_g),
        k_g=S_g / S_wt / governor.droop,
        b_gsc=2.0 * math.pi * turbine.f0 / x,
        b_msc=pmsg.pole_pairs * turbine.omega_base * pmsg.psi**2 * omega_del / pmsg.L * math.cos(rho) ** 2,
        K_gsc=control.K_gsc,
        K_msc=control.K_msc,
        K_d_gsc=control.K_d_gsc,
        K_d_msc=control.K_d_msc,
        K_wt=K_wr + K_beta * turbine.K_p,
    )
