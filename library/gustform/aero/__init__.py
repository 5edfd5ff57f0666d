"""Rotor aerodynamics: from wind, rotor speed and pitch to torque."""
