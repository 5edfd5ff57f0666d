"""Statuses of the runtime, as in gust_status.h."""

from enum import IntEnum


class Status(IntEnum):
    """How a call to the runtime ended: 0 done, greater than 0 stopped for a stated reason, less than 0 an error."""

    OK = 0
    STOP_REQUESTED = 1
    END_OF_DATA = 2
    SINK_STOPPED = 3
    CONTROLLER_STOPPED = 4
    BAD_ARGUMENT = -1
    BAD_ORDER = -2
    UNKNOWN_OPTION = -3
    OUT_OF_MEMORY = -4
    FILE_UNREADABLE = -101
    BAD_CONTAINER = -102
    BAD_TABLE = -103
    BAD_KERNEL = -104
    BAD_CONTROLLER = -105
    NOT_FINITE = -201
    SINGULAR = -202
    NOT_CONSISTENT = -203
    STEP_TOO_SMALL = -301
    NO_CONVERGENCE = -302
    SINGULAR_STEP = -303
    NOT_FINITE_STEP = -304
    SOLVER_FAILED = -305
    EVENT_ITERATION = -401
    CHATTERING = -402
    RESTART_FAILED = -403
    BAD_PERIOD = -404
    CONTROLLER_FAILED = -405
    SERIES_UNREADABLE = -501
    BAD_SERIES = -502
    SERIES_NOT_COVERING = -503
    SINK_FAILED = -601
    CHECKPOINT_FAILED = -602
    CHECKPOINT_UNREADABLE = -603
    BAD_CHECKPOINT = -604
    FOREIGN_CHECKPOINT = -605


class RunError(Exception):
    """An error of the runtime: what kind (`code`), and where and why in words (`message`)."""

    def __init__(self, code: Status, message: str) -> None:
        super().__init__(message)
        self.code = code
        self.message = message

    def __str__(self) -> str:
        return f"{self.code.name}: {self.message}"
