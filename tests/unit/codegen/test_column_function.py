from __future__ import annotations

import threading

import casadi as ca
import numpy as np

from gustform_codegen.column_function import ColumnFunction

X, NONE = ca.SX.sym("x", 3), ca.SX.sym("none", 0)


def function() -> ColumnFunction:
    """(x0 x1, 0, x2^2) and x0 + x2: zeros that CasADi leaves out must stand in the result."""
    return ColumnFunction("f", [X, NONE], [ca.vertcat(X[0] * X[1], 0, X[2] ** 2), X[0] + X[2]])


def test_columns_are_instances() -> None:
    f = function()
    for instances in (1, 4, 1):
        x = np.arange(3.0 * instances).reshape(3, instances)
        first, second = f([x, np.zeros((0, instances))])
        assert np.array_equal(first, [x[0] * x[1], 0 * x[0], x[2] ** 2])
        assert np.array_equal(second, [x[0] + x[2]])


def test_results_are_the_callers_own() -> None:
    f = function()
    one = f([np.ones((3, 2)), np.zeros((0, 2))])[0]
    f([np.zeros((3, 2)), np.zeros((0, 2))])
    assert np.array_equal(one, [[1.0, 1.0], [0.0, 0.0], [1.0, 1.0]])


def test_threads_do_not_see_each_others_values() -> None:
    f = function()
    wrong: list[float] = []

    def work(value: float) -> None:
        for _ in range(300):
            got = f([np.full((3, 1), value), np.zeros((0, 1))])[1][0, 0]
            if got != 2.0 * value:
                wrong.append(got)

    threads = [threading.Thread(target=work, args=(float(k),)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
