"""The functions of libgustform.so with their types."""

import ctypes
from ctypes import POINTER, c_char_p, c_double, c_float, c_int, c_int32, c_int64, c_size_t, c_void_p
from functools import cache

from gustform_runtime.errors import Status
from gustform_runtime.locate import library_path

SERIES_READER = ctypes.CFUNCTYPE(c_int, c_void_p, c_int64, c_int64, POINTER(c_double), POINTER(c_double))
SAMPLED_STEP = ctypes.CFUNCTYPE(c_int, c_void_p, c_double, POINTER(c_double), POINTER(c_double))
ROW_SINK = ctypes.CFUNCTYPE(c_int, c_void_p, c_int64, POINTER(c_double), POINTER(c_float))


class Counters(ctypes.Structure):
    """gust_statistics of gust_sim.h, field by field."""

    _fields_ = (
        ("steps", c_int64),
        ("residual_evaluations", c_int64),
        ("jacobian_evaluations", c_int64),
        ("factorisations", c_int64),
        ("refactorisations", c_int64),
        ("error_test_failures", c_int64),
        ("nonlinear_iterations", c_int64),
        ("nonlinear_failures", c_int64),
        ("root_evaluations", c_int64),
        ("events", c_int64),
        ("restarts", c_int64),
        ("initial_iterations", c_int64),
        ("rows", c_int64),
        ("cut_steps", c_int64),
        ("last_step", c_double),
        ("last_order", c_int32),
    )


class SampledInfo(ctypes.Structure):
    """gust_sampled_info of gust_model.h, field by field."""

    _fields_ = (
        ("name", c_char_p),
        ("period", c_double),
        ("delay", c_int32),
        ("real_size", c_int32),
        ("n_measurements", c_int32),
        ("n_commands", c_int32),
        ("measurement_name", POINTER(c_char_p)),
        ("measurement_unit", POINTER(c_char_p)),
        ("command_name", POINTER(c_char_p)),
        ("command_unit", POINTER(c_char_p)),
        ("command_start", POINTER(c_double)),
    )


SAMPLED_ERRORS = 8  # bits of an error signal that are counted


class SampledCounters(ctypes.Structure):
    """gust_sampled_statistics of gust_sim.h, field by field."""

    _fields_ = (
        ("samples", c_int64),
        ("bad_samples", c_int64),
        ("errors", c_int64 * SAMPLED_ERRORS),
        ("first_error", c_double),
    )


class OptionInfo(ctypes.Structure):
    """gust_option_info of gust_sim.h, field by field."""

    _fields_ = (
        ("name", c_char_p),
        ("sentence", c_char_p),
        ("initial", c_double),
        ("minimum", c_double),
        ("maximum", c_double),
    )


class StatsChannel(ctypes.Structure):
    """gust_stats_channel of gust_stats.h, field by field."""

    _fields_ = (
        ("column", c_int32),
        ("n_edges", c_int32),
        ("edges", c_void_p),
        ("segment", c_int32),
        ("n_exponents", c_int32),
        ("exponents", c_void_p),
        ("n_ranges", c_int32),
        ("range_width", c_double),
    )


class MomentsResult(ctypes.Structure):
    """gust_stats_moments_result of gust_stats.h, field by field."""

    _fields_ = (
        ("count", c_int64),
        ("not_finite", c_int64),
        ("mean", c_double),
        ("deviation", c_double),
        ("minimum", c_double),
        ("t_minimum", c_double),
        ("maximum", c_double),
        ("t_maximum", c_double),
    )


class CyclesResult(ctypes.Structure):
    """gust_stats_cycles_result of gust_stats.h, field by field."""

    _fields_ = (
        ("full", c_int64),
        ("half", c_int64),
        ("forced", c_int64),
        ("largest", c_double),
    )


_HANDLE = c_void_p
_NUMBERS = c_void_p  # address of a numpy array

# name: (result, arguments)
_SIGNATURES: dict[str, tuple[type | None, tuple[type, ...]]] = {
    "gust_status_text": (c_char_p, (c_int,)),
    "gust_status_name": (c_char_p, (c_int,)),
    "gust_status_list": (c_int, (c_int,)),
    "gust_sundials_version": (c_char_p, ()),
    "gust_klu_version": (c_char_p, ()),
    "gust_option_list": (POINTER(OptionInfo), (c_int,)),
    "gust_model_load": (c_int, (c_char_p, POINTER(_HANDLE), c_char_p, c_size_t)),
    "gust_model_parse": (c_int, (c_char_p, c_size_t, POINTER(_HANDLE), c_char_p, c_size_t)),
    "gust_model_destroy": (None, (POINTER(_HANDLE),)),
    "gust_model_n_unknowns": (c_int32, (_HANDLE,)),
    "gust_model_n_nonzeros": (c_int32, (_HANDLE,)),
    "gust_model_n_channels": (c_int32, (_HANDLE,)),
    "gust_model_channel_name": (c_char_p, (_HANDLE, c_int32)),
    "gust_model_channel_unit": (c_char_p, (_HANDLE, c_int32)),
    "gust_model_n_sampled": (c_int32, (_HANDLE,)),
    "gust_model_sampled_block": (POINTER(SampledInfo), (_HANDLE, c_int32)),
    "gust_sim_create": (c_int, (_HANDLE, POINTER(_HANDLE))),
    "gust_sim_destroy": (None, (POINTER(_HANDLE),)),
    "gust_sim_set_option": (c_int, (_HANDLE, c_char_p, c_double)),
    "gust_sim_set_series_reader": (c_int, (_HANDLE, c_int32, SERIES_READER, c_void_p)),
    "gust_sim_set_sink": (c_int, (_HANDLE, c_double, c_int32, ROW_SINK, c_void_p)),
    "gust_sim_set_sampled": (c_int, (_HANDLE, c_int32, SAMPLED_STEP, c_void_p)),
    "gust_sim_sampled_statistics": (c_int, (_HANDLE, c_int32, POINTER(SampledCounters))),
    "gust_sim_initialise": (c_int, (_HANDLE, c_double)),
    "gust_sim_advance": (c_int, (_HANDLE, c_double, POINTER(c_double))),
    "gust_sim_request_stop": (None, (_HANDLE,)),
    "gust_sim_time": (c_double, (_HANDLE,)),
    "gust_sim_message": (c_char_p, (_HANDLE,)),
    "gust_sim_statistics": (c_int, (_HANDLE, POINTER(Counters))),
    "gust_sim_state": (c_int, (_HANDLE, POINTER(c_double), _NUMBERS, _NUMBERS)),
    "gust_sim_channels": (c_int, (_HANDLE, _NUMBERS)),
    "gust_sim_residual": (c_int, (_HANDLE, c_double, _NUMBERS, _NUMBERS, _NUMBERS)),
    "gust_sim_set_statistics": (c_int, (_HANDLE, _HANDLE, c_double)),
    "gust_sim_jacobian": (c_int, (_HANDLE, c_double, _NUMBERS, _NUMBERS, c_double, _NUMBERS)),
    "gust_sim_checkpoint": (c_int, (_HANDLE, c_char_p)),
    "gust_sim_checkpoint_bytes": (c_int, (_HANDLE, POINTER(c_void_p), POINTER(c_size_t))),
    "gust_sim_restore": (c_int, (_HANDLE, c_char_p)),
    "gust_sim_restore_bytes": (c_int, (_HANDLE, c_char_p, c_size_t)),
    "gust_stats_create": (
        c_int,
        (POINTER(StatsChannel), c_int32, c_int32, c_double, POINTER(_HANDLE), c_char_p, c_size_t),
    ),
    "gust_stats_destroy": (None, (POINTER(_HANDLE),)),
    "gust_stats_add": (c_int, (_HANDLE, c_int64, _NUMBERS, _NUMBERS)),
    "gust_stats_moments": (c_int, (_HANDLE, c_int32, POINTER(MomentsResult))),
    "gust_stats_histogram": (c_int, (_HANDLE, c_int32, _NUMBERS, POINTER(c_int64), POINTER(c_int64))),
    "gust_stats_spectrum": (c_int, (_HANDLE, c_int32, _NUMBERS, POINTER(c_int64))),
    "gust_stats_cycles": (c_int, (_HANDLE, c_int32, _NUMBERS, _NUMBERS, POINTER(CyclesResult))),
    "gust_stats_size": (c_size_t, (_HANDLE,)),
    "gust_stats_save": (c_int, (_HANDLE, c_char_p, c_size_t, POINTER(c_size_t))),
    "gust_stats_restore": (c_int, (_HANDLE, c_char_p, c_size_t)),
}


def _check_statuses(loaded: ctypes.CDLL) -> None:
    """The library must know the same statuses as this package: a stale one would be misread."""
    known = {status.name: int(status) for status in Status}
    there = {"OK": 0}
    while number := loaded.gust_status_list(len(there)):
        there[loaded.gust_status_name(number).decode()] = number
    if there != known:
        odd = ", ".join(sorted(name for name, _ in there.items() ^ known.items()))
        raise ImportError(f"{library_path()} is of another version than this package ({odd}): build it again")


@cache
def library() -> ctypes.CDLL:
    """libgustform.so, loaded once; calls release the GIL."""
    loaded = ctypes.CDLL(str(library_path()))
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(loaded, name)
        function.restype = result
        function.argtypes = arguments
    _check_statuses(loaded)
    return loaded
