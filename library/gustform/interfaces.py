"""Connector types of the library.

AC phasors: v is the line-to-line RMS voltage phasor and i is scaled so that v * conj(i) is the three-phase complex
power (i = sqrt(3) times the line current). With currents positive into the component,

    P = vr ir + vi ii,   Q = vi ir - vr ii

are the powers flowing INTO it. The phasor frame rotates at the speed of a reference machine (the signal `frame`, pu
of nominal frequency), so phasors stand still at any common frequency.
"""

from gustform.language import Connector, Flow, Potential


class AcPort(Connector):
    """Balanced three-phase phasor terminal."""

    vr = Potential("V", "real part of the line-to-line RMS voltage phasor")
    vi = Potential("V", "imaginary part of the line-to-line RMS voltage phasor")
    ir = Flow("A", "real part of the current phasor into the component, sqrt(3) times the line current")
    ii = Flow("A", "imaginary part of the current phasor into the component, sqrt(3) times the line current")


class DcPort(Connector):
    """Two-wire DC terminal."""

    v = Potential("V", "DC voltage")
    i = Flow("A", "DC current into the component")


class Shaft(Connector):
    """Rotating shaft described by its speed; torque positive into the component."""

    w = Potential("1/s", "angular speed, rad/s")
    tau = Flow("N*m", "torque into the component")
