"""A CasADi function evaluated for many instances at once, through its buffers.

A call of `casadi.Function` turns every argument into a DM and every result into an array, which takes a hundred times
as long as the arithmetic of a turbine. The buffers are read and written in place.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Buffers:
    """What one number of instances is evaluated with; arrays are (n, instances), columns one after another."""

    function: Any  # CasADi keeps no reference to it
    buffer: Any
    evaluate: Any
    arguments: list[Array]
    results: list[Array]


class ColumnFunction:
    """`expressions` of vector `arguments`; called with arrays (n, instances) it gives arrays (m, instances)."""

    def __init__(self, name: str, arguments: Sequence[Any], expressions: Sequence[Any]) -> None:
        inputs = [a if a.numel() else ca.SX(0, 1) for a in arguments]
        self._function = ca.Function(name, inputs, [ca.densify(e) for e in expressions])
        self._buffers: dict[int, _Buffers] = {}
        self._lock = threading.Lock()

    def __call__(self, arguments: Sequence[Array]) -> list[Array]:
        instances = arguments[0].shape[1]
        with self._lock:
            if instances not in self._buffers:
                self._buffers[instances] = self._new(instances)
            at = self._buffers[instances]
            for place, values in zip(at.arguments, arguments, strict=True):
                place[...] = values
            at.evaluate()
            return [result.copy() for result in at.results]

    def _new(self, instances: int) -> _Buffers:
        function = self._function.map(instances) if instances > 1 else self._function
        buffer, evaluate = function.buffer()

        def array(rows: int, bind: Any, number: int) -> Array:
            values = np.zeros((rows, instances), order="F")
            if values.size:
                bind(number, memoryview(values.ravel(order="K")))  # type: ignore[arg-type]
            return values

        one = self._function
        arguments = [array(one.size1_in(k), buffer.set_arg, k) for k in range(one.n_in())]
        results = [array(one.size1_out(k), buffer.set_res, k) for k in range(one.n_out())]
        return _Buffers(function, buffer, evaluate, arguments, results)
