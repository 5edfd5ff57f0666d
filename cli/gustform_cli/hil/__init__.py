"""The commands `gustform hil ...`: what combines a scenario with the bus; the bus itself is gustform_hil."""
