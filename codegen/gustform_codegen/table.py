"""SystemTable: a linked system as plain arrays, the contract between Python and C."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gustform_codegen.container import Sections, pack, strings

Ints = NDArray[np.int32]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TypeTable:
    """All instances of one unit type. Shapes: n instances first."""

    name: str
    kernel_path: str
    instance_names: list[str]
    unknown_names: list[str]
    equation_names: list[str]
    external_names: list[str]
    flow_names: list[str]
    root_names: list[str]
    when_names: list[str]
    parameter_names: list[str]
    first_unknown: Ints
    external: Ints
    flow_row: Ints
    jacobian_position: Ints
    first_input: Ints
    table: Ints
    parameters: Floats
    discrete: Floats
    root_kind: NDArray[np.uint8]
    when_root: Ints
    when_period: Ints


@dataclass(frozen=True, eq=False)
class SeriesTable:
    """A time series: which input slots it drives, and its samples unless a reader delivers them."""

    name: str
    unit: str
    slots: list[int]
    interpolation: int  # 0 linear, 1 hold, 2 pchip
    source: int  # 0 inline, 1 reader
    on_end: int  # 0 error, 1 hold, 2 repeat
    t0: float
    dt: float
    t_end: float
    time: Floats | None
    value: Floats | None


@dataclass(frozen=True, eq=False)
class LookupTable:
    """Uniform bicubic B-spline."""

    spline: dict[str, Any]


@dataclass(frozen=True, eq=False)
class SampledTable:
    """A controller beside the equations of one instance: what it measures there, and the discrete values it holds.

    `paths` are what the values of its parameters and states are called in the continuous unit.
    """

    name: str
    type: int
    instance: int
    library: int
    delay: int
    real_size: int
    state_offset: int  # in the context, bytes
    period: float
    measurement: Ints  # (m, 3): kind of channel, unknown or output, sign
    command: Ints  # discrete values of the instance
    monitor: Ints  # others, for what the controller tells of itself
    parameters: Floats
    states: Floats
    measurement_names: list[str]
    measurement_units: list[str]
    command_names: list[str]
    command_units: list[str]
    monitor_names: list[str]
    parameter_paths: list[str]
    state_paths: list[str]


@dataclass(frozen=True, eq=False)
class Sampled:
    """All sampled blocks, the libraries they share, and scheduled changes (time, block, parameter, value)."""

    libraries: list[str] = field(default_factory=list)
    blocks: list[SampledTable] = field(default_factory=list)
    changes: list[tuple[float, int, int, float]] = field(default_factory=list)

    def sections(self) -> Sections:
        """Their sections; none where there are none."""
        if not self.blocks:
            return {}
        counts = [len(self.libraries), len(self.blocks), len(self.changes)]
        s: Sections = {
            "sampled": np.array(counts, dtype=np.int32),
            "sampled_change_time": np.array([c[0] for c in self.changes], dtype=np.float64),
            "sampled_change_target": np.array([c[1:3] for c in self.changes], dtype=np.int32).ravel(),
            "sampled_change_value": np.array([c[3] for c in self.changes], dtype=np.float64),
        }
        for k, path in enumerate(self.libraries):
            s[f"library.{k}.path"] = strings([path])
        for k, b in enumerate(self.blocks):
            p = f"sampled.{k}."
            s[p + "name"] = strings([b.name])
            s[p + "kind"] = np.array(
                [b.type, b.instance, b.library, b.delay, b.real_size, b.state_offset], dtype=np.int32
            )
            s[p + "period"] = np.array([b.period])
            s[p + "measurement"] = b.measurement.ravel()
            for name in ("command", "monitor", "parameters", "states"):
                s[p + name] = getattr(b, name)
            for name in ("measurement_names", "measurement_units", "command_names", "command_units", "monitor_names"):
                s[p + name] = strings(getattr(b, name))
        return s


@dataclass(frozen=True, eq=False)
class Channel:
    """A recorded quantity: kind 0 unknown `a`; kind 1 output `b` of instance `a` (counted through all types)."""

    name: str
    unit: str
    description: str
    kind: int
    a: int
    b: int


@dataclass(frozen=True, eq=False)
class SystemTable:
    """The whole system. Arrays are never changed after linking; `with_start` and `with_channels` make new tables."""

    types: list[TypeTable]
    column_start: Ints
    row_index: Ints
    start: Floats
    start_derivative: Floats
    nominal: Floats
    differential: NDArray[np.uint8]
    input_value: Floats
    series: list[SeriesTable]
    tables: list[LookupTable]
    schedule_time: Floats
    schedule_target: Ints
    schedule_value: Floats
    sampled: Sampled = field(default_factory=Sampled)
    channels: list[Channel] = field(default_factory=list)
    metadata: dict[str, Any] = field(default_factory=dict)

    @property
    def n_unknowns(self) -> int:
        return int(self.start.size)

    @property
    def n_instances(self) -> int:
        return sum(len(t.instance_names) for t in self.types)

    def with_channels(self, channels: list[Channel]) -> SystemTable:
        return replace(self, channels=channels)

    def with_metadata(self, metadata: dict[str, Any]) -> SystemTable:
        return replace(self, metadata=metadata)

    def to_bytes(self) -> bytes:
        """The container that `gust_model_parse` and `gust-run` read."""
        s: Sections = {
            "counts": np.array(
                [
                    self.n_unknowns, self.row_index.size, len(self.types), self.input_value.size, len(self.series),
                    len(self.tables), self.schedule_time.size, len(self.channels),
                ],
                dtype=np.int32,
            ),
            "column_start": self.column_start,
            "row_index": self.row_index,
            "start": self.start,
            "start_derivative": self.start_derivative,
            "nominal": self.nominal,
            "differential": self.differential,
            "input_value": self.input_value,
            "schedule_time": self.schedule_time,
            "schedule_target": self.schedule_target.ravel(),
            "schedule_value": self.schedule_value,
            "channel": np.array([(c.kind, c.a, c.b) for c in self.channels], dtype=np.int32).reshape(-1),
            "channel_names": strings([c.name for c in self.channels]),
            "channel_units": strings([c.unit for c in self.channels]),
            "metadata": strings([json.dumps(self.metadata, sort_keys=True)]),
        }  # fmt: skip
        for k, t in enumerate(self.types):
            p = f"type.{k}."
            s[p + "counts"] = np.array([len(t.instance_names), 0], dtype=np.int32)
            s[p + "kernel"] = strings([t.kernel_path])
            s[p + "name"] = strings([t.name])
            for field_name in (
                "instance_names", "unknown_names", "equation_names", "external_names", "flow_names", "root_names",
                "when_names", "parameter_names",
            ):  # fmt: skip
                s[p + field_name] = strings(getattr(t, field_name))
            for field_name in (
                "first_unknown", "external", "flow_row", "jacobian_position", "first_input", "table", "parameters",
                "discrete", "root_kind", "when_root", "when_period",
            ):  # fmt: skip
                s[p + field_name] = getattr(t, field_name).ravel()
        for k, series in enumerate(self.series):
            p = f"series.{k}."
            stamped = series.time is not None
            s[p + "kind"] = np.array(
                [series.interpolation, series.source, series.on_end, 0 if stamped else 1], dtype=np.int32
            )
            s[p + "slots"] = np.array(series.slots, dtype=np.int32)
            s[p + "timing"] = np.array([series.t0, series.dt, series.t_end], dtype=np.float64)
            if series.time is not None:
                s[p + "time"] = series.time
            if series.value is not None:
                s[p + "value"] = series.value
            s[p + "name"] = strings([series.name])
            s[p + "unit"] = strings([series.unit])
        for k, table in enumerate(self.tables):
            p, spline = f"table.{k}.", table.spline
            s[p + "grid"] = np.array([spline["x_start"], spline["x_step"], spline["y_start"], spline["y_step"]])
            s[p + "size"] = np.array([spline["n_x"], spline["n_y"]], dtype=np.int32)
            s[p + "coefficient"] = spline["coefficient"]
        return pack(s | self.sampled.sections())
