"""Wind for a turbine: a constant, IEC turbulence made while running, or a file read in blocks."""
