"""From component trees to compiled unit types and linked systems."""

from gustform_codegen.build import Built, build
from gustform_codegen.cache import KernelCache
from gustform_codegen.initial import SteadyState, steady_state
from gustform_codegen.report import ModelReport, model_report

__all__ = ["Built", "KernelCache", "ModelReport", "SteadyState", "build", "model_report", "steady_state"]
