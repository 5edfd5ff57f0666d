"""The C runtime of gustform from Python: load a model table, run it, take its result rows.

Knows numpy and ctypes only; what a model means is none of its business.
"""

from gustform_runtime.errors import RunError, Status
from gustform_runtime.locate import gust_run_path, include_dir, library_path
from gustform_runtime.simulation import Option, SampledBlock, SampledCount, Simulation, solver_versions
from gustform_runtime.statistics import RAINFLOW, Cycles, Histogram, Keep, Moments, Spectrum, Statistics

__all__ = [
    "RAINFLOW",
    "Cycles",
    "Histogram",
    "Keep",
    "Moments",
    "Option",
    "RunError",
    "SampledBlock",
    "SampledCount",
    "Simulation",
    "Spectrum",
    "Statistics",
    "Status",
    "gust_run_path",
    "include_dir",
    "library_path",
    "solver_versions",
]
