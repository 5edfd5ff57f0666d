"""Machines, converters, network and loads at phasor (RMS) fidelity."""
