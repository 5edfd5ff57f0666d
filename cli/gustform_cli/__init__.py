"""The command `gustform`: from a YAML scenario to a result file and a figure."""
