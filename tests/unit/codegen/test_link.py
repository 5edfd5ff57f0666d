"""Linking: shared unknowns and flow sums, the merged pattern, signals, several types and many instances, refusals.

Numbers come from the compiled kernels through the arrays of the table alone (assembled.py).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gustform.interfaces import AcPort, DcPort
from gustform.language import Component, GustformError, Input, Output, Parameter, Part, Table, Variable, table2
from gustform.language.system import Constant, Series, System
from gustform.language.table import TableData
from gustform_codegen.build import Built, build
from gustform_codegen.cache import KernelCache
from gustform_codegen.container import read_strings, unpack
from gustform_codegen.link import Linked
from gustform_codegen.report import model_report
from tests.unit.codegen.assembled import Assembled
from tests.unit.codegen.circuits import Follower, IdealSource, Ladder, Load, Resistor, Storage


def refused(code: str, system: System, cache: KernelCache) -> str:
    with pytest.raises(GustformError) as refusal:
        build(system, cache)
    assert refusal.value.code == code, str(refusal.value)
    return str(refusal.value)


def network(n: int = 3) -> System:
    """A source, a line to a second bus, n loads and n storages there, and followers of one storage."""
    s = System()
    s.add("source", IdealSource(V=10.0))
    s.add("line", Resistor(R=0.25))
    s.connect("source.pin", "line.p")
    for k in range(n):
        s.add(f"load[{k}]", Load(R=2.0 + k))
        s.connect(f"load[{k}].pin", "line.n")
        s.add(f"store[{k}]", Storage(R=1.0 + k, C=0.5 + k))
        s.connect(f"store[{k}].pin", "line.n")
        s.add(f"follow[{k}]", Follower(T=0.1 * (1 + k)))
        s.connect(f"follow[{k}].pin", "line.n")
        s.signal(f"follow[{k}].u", f"store[{k}].v")
        s.bind(f"follow[{k}].bias", Constant(0.5 * k))
    return s


@pytest.fixture(scope="module")
def linked(cache_folder: Any) -> Linked:
    from tests.unit.codegen.compiled import INCLUDE

    return build(network(), KernelCache(INCLUDE, cache_folder)).linked


def random_point(linked: Linked, seed: int = 0) -> tuple[Any, Any]:
    random = np.random.default_rng(seed)
    n = linked.table.n_unknowns
    return random.uniform(0.5, 2.0, n), random.uniform(-1.0, 1.0, n)


# ---- layout ----


def test_instances_of_a_type_share_one_kernel_and_lie_one_after_the_other(linked: Linked) -> None:
    table = linked.table
    assert [(t.unit.name, t.names) for t in linked.types] == [
        ("IdealSource", ["source"]),
        ("Resistor", ["line"]),
        ("Load", ["load[0]", "load[1]", "load[2]"]),
        ("Storage", ["store[0]", "store[1]", "store[2]"]),
        ("Follower", ["follow[0]", "follow[1]", "follow[2]"]),
    ]
    assert len({t.kernel_path for t in linked.types}) == 5
    # Own unknowns: the source's current, a state for each storage and follower. Then the two buses.
    assert table.n_unknowns == 1 + 3 + 3 + 2
    assert linked.types[3].table.first_unknown.tolist() == [1, 2, 3]
    assert [linked.unknown_name(k) for k in range(9)] == [
        "source.pin.i", "store[0].v", "store[1].v", "store[2].v", "follow[0].x", "follow[1].x", "follow[2].x",
        "source.pin.v", "line.n.v",
    ]  # fmt: skip
    assert table.differential.tolist() == [0, 1, 1, 1, 1, 1, 1, 0, 0]
    assert linked.row_text(0).startswith("source: pin.v = V (circuits.py:")
    assert linked.row_text(8) == "sum of flows at line.n.v"


def test_all_ports_of_a_set_share_one_unknown(linked: Linked) -> None:
    assert linked.shared["source.pin.v"] == linked.shared["line.p.v"] == 7
    assert {v for k, v in linked.shared.items() if not k.startswith(("source", "line.p"))} == {8}
    assert linked.types[1].table.external.tolist() == [[7, 8]]
    assert linked.types[1].table.flow_row.tolist() == [[7, 8]]  # a sum row has the number of its potential


def test_start_and_nominal_come_from_the_declarations(linked: Linked) -> None:
    table = linked.table
    assert table.start[1:4].tolist() == [1.0, 1.0, 1.0]
    assert table.nominal[1:4].tolist() == [2.0, 2.0, 2.0]
    # A shared potential takes both from the first port that declares them: here the storages', not the line's.
    assert (table.start[8], table.nominal[8]) == (3.0, 4.0)
    assert (table.start[7], table.nominal[7]) == (10.0, 1.0)  # the source's start is its V


def test_start_values_given_to_instances(cache: KernelCache) -> None:
    s = System()
    s.add("source", IdealSource(V=7.0))
    s.add("a", Storage(v=4.0))
    s.add("b", Storage())
    s.connect("source.pin", "a.pin")
    s.connect("source.pin", "b.pin")
    table = build(s, cache).linked.table
    assert table.start.tolist() == [0.0, 4.0, 1.0, 7.0]  # current, two states, the potential by the source's V


# ---- numbers ----


def test_the_residual_is_that_of_the_equations(linked: Linked) -> None:
    assembled = Assembled(linked)
    y, yp = random_point(linked)
    r = assembled.residual(y, yp)
    current, v, x, bus, far = y[0], y[1:4], y[4:7], y[7], y[8]
    load_r, store_r, store_c, t = 2.0 + np.arange(3), 1.0 + np.arange(3), 0.5 + np.arange(3), 0.1 * (1 + np.arange(3))
    np.testing.assert_allclose(r[0], bus - 10.0, rtol=1e-12)
    np.testing.assert_allclose(r[1:4], yp[1:4] - (far - v) / store_r / store_c, rtol=1e-12)
    np.testing.assert_allclose(r[4:7], yp[4:7] - (v + 0.5 * np.arange(3) - x) / t, rtol=1e-12)
    # Kirchhoff at both buses: currents INTO the components sum to zero. G of a follower is 0.2 S.
    np.testing.assert_allclose(r[7], current + (bus - far) / 0.25, rtol=1e-12)
    into = np.sum(far / load_r) + np.sum((far - v) / store_r) + np.sum(0.2 * (far - x))
    np.testing.assert_allclose(r[8], -(bus - far) / 0.25 + into, rtol=1e-12)


@pytest.mark.parametrize("cj", [0.0, 1.0, 250.0])
def test_the_merged_jacobian_is_the_derivative_of_the_assembled_residual(linked: Linked, cj: float) -> None:
    assembled = Assembled(linked)
    y, yp = random_point(linked, 1)
    # The network is linear, so central differences with h = 1e-6 are right to rounding: 1e-16 * 1e3 / 1e-6.
    np.testing.assert_allclose(assembled.jacobian(y, yp, cj), assembled.differences(y, yp, cj), rtol=1e-6, atol=1e-6)


def test_the_pattern_is_sorted_without_repetition_and_exact(linked: Linked) -> None:
    table = linked.table
    assert table.column_start[0] == 0
    assert table.column_start[-1] == table.row_index.size
    for column in range(table.n_unknowns):
        rows = table.row_index[table.column_start[column] : table.column_start[column + 1]]
        assert np.all(np.diff(rows) > 0)
    assembled = Assembled(linked)
    y, yp = random_point(linked, 2)
    pattern = np.zeros((table.n_unknowns, table.n_unknowns), bool)
    pattern[table.row_index, np.repeat(np.arange(table.n_unknowns), np.diff(table.column_start))] = True
    assert (pattern == (assembled.differences(y, yp, 1.0) != 0)).all()  # no entry is always zero, none is missing


def test_the_network_at_rest_by_nodal_analysis(linked: Linked) -> None:
    y = Assembled(linked).rest()
    # At rest a storage carries no current and sits at the bus; a follower then sees far + bias.
    conductance = 1 / 0.25 + np.sum(1 / (2.0 + np.arange(3)))
    bias = 0.5 * np.arange(3)
    far = (10.0 / 0.25 + 0.2 * bias.sum()) / conductance
    np.testing.assert_allclose(y[8], far, rtol=1e-12)
    np.testing.assert_allclose(y[1:4], far, rtol=1e-12)
    np.testing.assert_allclose(y[0], -(10.0 - far) / 0.25, rtol=1e-12)  # the source delivers: negative into it


def test_every_channel_has_its_value(linked: Linked) -> None:
    channels, aliases = linked.select(["*"])
    y, yp = random_point(linked, 3)
    values = Assembled(linked, linked.table.with_channels(channels)).channels(y, yp)
    values.update({name: sign * values[target] for name, (target, sign) in aliases.items()})
    far = y[8]
    for k in range(3):
        assert values[f"load[{k}].pin.v"] == far
        assert values[f"load[{k}].P"] == pytest.approx(far**2 / (2.0 + k), rel=1e-12)
        assert values[f"store[{k}].soc"] == y[1 + k]
        assert values[f"store[{k}].minus"] == -y[1 + k]
        assert values[f"store[{k}].pin.i"] == pytest.approx((far - y[1 + k]) / (1.0 + k), rel=1e-12)
        assert values[f"follow[{k}].u"] == y[1 + k]
        assert values[f"follow[{k}].bias"] == 0.5 * k
    assert values["line.n.i"] == pytest.approx(-(y[7] - far) / 0.25, rel=1e-12)
    assert values["line.v"] == pytest.approx(y[7] - far, rel=1e-12)


# ---- choosing channels ----


def test_channels_keep_the_name_asked_for_and_the_rest_are_aliases(linked: Linked) -> None:
    channels, aliases = linked.select(["store[1].soc", "store[1].v", "store[1].minus", "load[0].pin.v", "line.n.v"])
    assert [c.name for c in channels] == ["store[1].soc", "load[0].pin.v"]
    assert aliases == {
        "store[1].v": ("store[1].soc", 1),
        "store[1].minus": ("store[1].soc", -1),
        "line.n.v": ("load[0].pin.v", 1),
    }
    assert (channels[0].unit, channels[0].description) == ("V", "capacitor voltage")


def test_an_alias_with_a_minus_alone_records_what_it_stands_for(linked: Linked) -> None:
    channels, aliases = linked.select(["store[1].minus"])
    assert [c.name for c in channels] == ["store[1].v"]
    assert aliases == {"store[1].minus": ("store[1].v", -1)}


def test_patterns(linked: Linked) -> None:
    assert [c.name for c in linked.select(["follow[1].x", "follow[2].*x"])[0]] == ["follow[1].x", "follow[2].x"]
    assert [c.name for c in linked.select(["*.x"])[0]] == ["follow[0].x", "follow[1].x", "follow[2].x"]
    assert [c.name for c in linked.select(["store[?].v"])[0]] == ["store[0].v", "store[1].v", "store[2].v"]
    with pytest.raises(GustformError, match=r"GF2011.*no variable matches 'lod.*P'.*try load\[0\]\.P"):
        linked.select(["lod[0].P"])
    with pytest.raises(GustformError, match="GF2011"):
        linked.select(["store[0].v", "nothing.*"])


def test_one_channel_by_name(linked: Linked) -> None:
    found = linked.channel("store[2].minus")
    assert found is not None
    channel, sign = found
    assert (channel.kind, channel.a, sign) == (0, 3, -1)
    assert linked.channel("store[2].nothing") is None
    assert linked.channel("nobody.v") is None


# ---- signals ----


@pytest.mark.parametrize(
    ("source", "value"),
    [
        ("store.v", lambda v, far: v),  # a state
        ("store.soc", lambda v, far: v),  # its alias
        ("store.minus", lambda v, far: -v),  # its alias with the other sign
        ("store.seen", lambda v, far: far),  # an alias of the terminal's potential
        ("load.P", lambda v, far: far**2 / 2.0),  # explicit: must be kept as an unknown
    ],
)
def test_signals_of_every_sort(source: str, value: Any, cache: KernelCache) -> None:
    class Reader(Follower):
        u = Input("W" if source == "load.P" else "V", "signal")
        bias = Input("W" if source == "load.P" else "V", "offset")
        x = Variable("W" if source == "load.P" else "V", "state")

        def equations(self) -> None:
            self.eq(self.T * self.der(self.x), self.gain * (self.u + self.bias) - self.x)
            self.eq(self.pin.i, 0)

    s = System()
    s.add("source", IdealSource(V=4.0))
    s.add("load", Load(R=2.0))
    s.add("store", Storage())
    s.add("reader", Reader(T=0.5))
    for name in ("load", "store", "reader"):
        s.connect("source.pin", f"{name}.pin")
    s.signal("reader.u", source)
    s.bind("reader.bias", Constant(0.0))
    linked = build(s, cache).linked
    assembled = Assembled(linked)
    y, yp = random_point(linked)
    position = {linked.unknown_name(k): k for k in range(linked.table.n_unknowns)}
    far, v, x = (y[position[name]] for name in ("source.pin.v", "store.v", "reader.x"))
    if source in position and source != "store.v":  # an unknown of its own: its row says what it is
        read = y[position[source]]
        assert assembled.residual(y, yp)[position[source]] == pytest.approx(read - value(v, far), rel=1e-12)
    else:
        read = value(v, far)
    expected = yp[position["reader.x"]] - (read - x) / 0.5
    assert assembled.residual(y, yp)[position["reader.x"]] == pytest.approx(expected, rel=1e-12)
    np.testing.assert_allclose(assembled.jacobian(y, yp, 2.0), assembled.differences(y, yp, 2.0), rtol=1e-6, atol=1e-6)


def test_signals_that_are_not_there(cache: KernelCache) -> None:
    s = network(1)
    s.signals["follow[0].u"] = "store[0].w"
    text = refused("GF3007", s, cache)
    assert "follow[0].u reads store[0].w, which store[0] does not have — try " in text
    s.signals["follow[0].u"] = "store[0].so"
    assert refused("GF3007", s, cache).endswith("try soc")


def test_inputs_must_be_driven(cache: KernelCache) -> None:
    s = network(1)
    del s.inputs["follow[0].bias"]
    assert "input follow[0].bias is not driven (offset, V) — try a signal or a source" in refused("GF3006", s, cache)


# ---- series, tables, schedule ----


def test_series_drive_their_slots(cache: KernelCache) -> None:
    s = network(2)
    gusts = Series("gusts", 3.0, dt=0.1, value=np.arange(5.0), on_end="repeat")
    s.bind("follow[0].bias", gusts)
    s.bind("follow[1].bias", gusts)  # one series may drive several inputs
    linked = build(s, cache).linked
    (series,) = linked.table.series
    assert series.slots == [0, 1]
    assert (series.interpolation, series.source, series.on_end, series.unit) == (0, 0, 2, "V")
    assert linked.table.input_value.tolist() == [3.0, 3.0]
    s.bind("follow[0].bias", Series("read", 1.0, time=np.empty(0), interpolation="hold", t_end=9.0))
    read, other = build(s, cache).linked.table.series
    assert (read.source, read.interpolation, read.slots, other.slots) == (1, 1, [0], [1])


class Look(Component):
    cp = Table("1", "1", "1", "table")
    G = Parameter("S", "conductance", default=1.0)
    one = Parameter("V", "base", default=1.0)
    y = Output("1", "looked up")
    pin = DcPort("terminal")

    def equations(self) -> None:
        self.eq(self.y, table2(self.cp, self.pin.v / self.one, 0.5))
        self.eq(self.pin.i, self.G * self.one * self.y)


def test_instances_of_one_type_may_have_tables_of_their_own(cache: KernelCache) -> None:
    grid = np.linspace(0.0, 3.0, 7)
    rising = TableData(grid, grid, np.add.outer(grid, grid), name="rising")
    flat = TableData(grid, grid, np.full((7, 7), 2.0), name="flat")
    s = System()
    s.add("source", IdealSource(V=1.25))
    for name, data in (("a", rising), ("b", flat), ("c", rising)):
        s.add(name, Look(cp=data))
        s.connect("source.pin", f"{name}.pin")
    linked = build(s, cache).linked
    assert linked.types[1].table.table.tolist() == [[0], [1], [0]]
    assert len(linked.table.tables) == 2  # data that is shared is kept once
    channels, _ = linked.select(["*.y"])
    assembled = Assembled(linked, linked.table.with_channels(channels), [rising, flat])
    y = assembled.rest()
    values = assembled.channels(y, np.zeros_like(y))
    assert values == {"a.y": pytest.approx(1.75), "b.y": pytest.approx(2.0), "c.y": pytest.approx(1.75)}
    assert y[0] == pytest.approx(-(1.75 + 2.0 + 1.75))  # what the source delivers


def test_scheduled_changes_carry_along_what_is_computed_from_them(cache: KernelCache) -> None:
    s = network(2)
    s.change(20.0, "follow[1].gain", 4.0)
    s.change(10.0, "follow[1].gain", 2.0)
    s.change(15.0, "load[0].R", 9.0)
    s.change(30.0, "follow[1].G", 0.7)
    s.change(40.0, "follow[1].gain", 8.0)  # G was set by hand since: it no longer follows
    linked = build(s, cache).linked
    rows = [
        (time, linked.types[t].names[k], linked.types[t].unit.parameters[p].path, value)
        for time, (t, k, p), value in zip(
            linked.table.schedule_time.tolist(),
            linked.table.schedule_target.reshape(-1, 3).tolist(),
            linked.table.schedule_value.tolist(),
            strict=True,
        )
    ]
    assert [(t, n, p, round(v, 12)) for t, n, p, v in rows] == [
        (10.0, "follow[1]", "G", 0.1), (10.0, "follow[1]", "gain", 2.0),
        (15.0, "load[0]", "R", 9.0),
        (20.0, "follow[1]", "G", 0.05), (20.0, "follow[1]", "gain", 4.0),
        (30.0, "follow[1]", "G", 0.7),
        (40.0, "follow[1]", "gain", 8.0),
    ]  # fmt: skip
    # The values before the run are untouched.
    gain = [p.path for p in linked.types[4].unit.parameters].index("gain")
    assert linked.types[4].table.parameters[:, gain].tolist() == [1.0, 1.0]


def test_a_change_inside_a_part_and_of_a_free_parameter(cache: KernelCache) -> None:
    class Charger(Component):
        I0 = Parameter("A", "current", free=True, start=1.0)
        I = Output("A", "what is shown")  # noqa: E741
        pin = DcPort("terminal")
        ladder = Part(Ladder, "a ladder")

        def equations(self) -> None:
            self.connect(self.pin, self.ladder.pin)
            self.eq(self.I, self.I0)
            self.initial(self.I, 2 * self.pin.i)

    s = System()
    s.add("source", IdealSource())
    s.add("charger", Charger())
    s.connect("source.pin", "charger.pin")
    s.change(1.0, "charger.ladder.R", 5.0)
    s.change(2.0, "charger.I0", 1.0)  # the start is 1, but the value found at the start may be another
    linked = build(s, cache).linked
    names = [p.path for p in linked.types[1].unit.parameters]
    targets = linked.table.schedule_target.reshape(-1, 3).tolist()
    assert [names[p] for _, _, p in targets] == ["ladder.R", "ladder.first.R", "ladder.second.R", "I0"]
    assert linked.table.schedule_value.tolist() == [5.0, 5.0, 5.0, 1.0]


# ---- the table as bytes ----


def test_the_bytes_hold_what_the_table_says(linked: Linked) -> None:
    channels, _ = linked.select(["store[*].v", "load[0].P"])
    table = linked.table.with_channels(channels).with_metadata({"b": 1, "a": "ä"})
    s = unpack(table.to_bytes())
    assert s["counts"].tolist() == [9, table.row_index.size, 5, 3, 0, 0, 0, 4]
    assert read_strings(s["type.3.instance_names"]) == ["store[0]", "store[1]", "store[2]"]
    assert read_strings(s["type.3.unknown_names"]) == ["v"]
    assert read_strings(s["channel_names"]) == ["store[0].v", "store[1].v", "store[2].v", "load[0].P"]
    assert s["channel"].reshape(-1, 3).tolist()[0] == [0, 1, 0]
    assert s["channel"].reshape(-1, 3)[3, :2].tolist() == [1, 2]  # output of the third instance, counted from 0
    assert read_strings(s["metadata"]) == ['{"a": "\\u00e4", "b": 1}']
    for number, t in enumerate(table.types):
        assert s[f"type.{number}.counts"].tolist() == [len(t.instance_names), 0]
        np.testing.assert_array_equal(s[f"type.{number}.parameters"], t.parameters.ravel())
        np.testing.assert_array_equal(s[f"type.{number}.jacobian_position"], t.jacobian_position.ravel())
    dtypes = {name.rpartition(".")[2]: a.dtype.str for name, a in s.items()}
    wanted = {"start": "<f8", "external": "<i4", "flow_row": "<i4", "differential": "|u1", "root_kind": "|u1",
              "when_root": "<i4", "schedule_target": "<i4", "first_input": "<i4", "discrete": "<f8"}  # fmt: skip
    assert {name: dtypes[name] for name in wanted} == wanted
    assert table.to_bytes() == table.to_bytes()


def test_the_report_counts(linked: Linked) -> None:
    report = model_report(linked)
    assert (report.instances, report.unknowns, report.equations, report.states) == (11, 9, 9, 6)
    assert (report.connection_unknowns, report.inputs, report.series) == (2, 3, 0)
    storage = next(t for t in report.types if t.name == "Storage")
    assert (storage.instances, storage.states, storage.iteration_variables, storage.substituted) == (3, 1, 0, 1)
    assert (storage.declared_equations, storage.aliases) == (5, 3)
    assert report.nonzeros == linked.table.row_index.size
    assert report.as_dict()["unknowns"] == 9


def test_the_report_warns_of_tables_that_were_resampled(cache: KernelCache) -> None:
    even, odd = np.linspace(0.0, 3.0, 7), np.array([0.0, 0.37, 1.0, 1.9, 2.35, 3.0])
    s = System()
    s.add("source", IdealSource(V=1.25))
    s.add("even", Look(cp=TableData(even, even, np.sin(np.add.outer(even, even)), "even.csv")))
    s.add("odd", Look(cp=TableData(odd, even, np.sin(3 * np.add.outer(odd, even)), "odd.csv")))
    s.add("odd_too", Look(cp=s.components["odd"].table("cp")))
    for name in ("even", "odd", "odd_too"):
        s.connect("source.pin", f"{name}.pin")
    (warning,) = model_report(build(s, cache).linked).warnings  # one for each table, none for rounding
    assert warning.startswith("odd.cp: table odd.csv differs from its uniform spline by at most 0.")


# ---- refusals ----


def test_a_port_left_open_is_named(cache: KernelCache) -> None:
    s = network(1)
    s.add("spare", Load())
    assert "spare.pin is not connected (terminal) — try at: a bus, or a connection of spare.pin" in refused(
        "GF3003", s, cache
    )


def test_an_optional_port_may_stay_open(cache: KernelCache) -> None:
    class Tapped(Component):
        R = Parameter("ohm", "resistance", default=2.0)
        main = DcPort("main")
        tap = DcPort("tap", optional=True, start={"v": 1.5})

        def equations(self) -> None:
            self.eq(self.main.v - self.tap.v, self.R * self.main.i)
            self.eq(self.main.i + self.tap.i, 0)

    s = System()
    s.add("source", IdealSource(V=3.0))
    s.add("open", Tapped())
    s.add("used", Tapped())
    s.add("load", Load(R=1.0))
    s.connect("source.pin", "open.main")
    s.connect("source.pin", "used.main")
    s.connect("used.tap", "load.pin")
    linked = build(s, cache).linked
    y = Assembled(linked).rest()
    position = {linked.unknown_name(k): k for k in range(y.size)}
    assert y[position["open.tap.v"]] == pytest.approx(3.0)  # no current, no drop
    assert y[linked.shared["load.pin.v"]] == pytest.approx(1.0)  # 3 V over 2 + 1 ohm
    assert linked.table.start[position["open.tap.v"]] == 1.5


def test_two_ideal_sources_on_one_bus(cache: KernelCache) -> None:
    s = System()
    for name in ("one", "two"):
        s.add(name, IdealSource())
    s.add("load", Load())
    s.add("far", Load())
    s.add("line", Resistor())
    s.connect("one.pin", "two.pin")
    s.connect("one.pin", "load.pin")
    s.connect("one.pin", "line.p")
    s.connect("line.n", "far.pin")
    text = refused("GF3020", s, cache)
    assert "one: pin.v = V" in text
    assert "two: pin.v = V" in text
    assert "nothing determines one.pin.i, two.pin.i" in text
    for innocent in ("far", "load", "line"):
        assert innocent not in text.partition(" — try ")[0]


class Pole(Component):
    """A capacitor straight at its terminal: the terminal's potential is its state."""

    C = Parameter("F", "capacitance", default=1.0)
    v = Variable("V", "voltage")
    pin = DcPort("terminal")

    def equations(self) -> None:
        self.eq(self.v, self.pin.v)
        self.eq(self.C * self.der(self.v), self.pin.i)


def test_two_states_that_the_connection_makes_equal(cache: KernelCache) -> None:
    s = System()
    s.add("one", Pole())
    s.add("load", Load())
    s.connect("one.pin", "load.pin")
    assert build(s, cache).linked.table.differential.sum() == 1  # alone it is a state like any other
    s.add("two", Pole(C=2.0))
    s.connect("one.pin", "two.pin")
    text = refused("GF3020", s, cache)
    assert "one: v = pin.v" in text
    assert "two: v = pin.v" in text
    assert "load: " not in text


class Watched(Component):
    """Draws a current that depends on another bus only: nothing ties its own voltage down."""

    G = Parameter("S", "conductance", default=1.0)
    here = DcPort("here")
    there = DcPort("there")

    def equations(self) -> None:
        self.eq(self.here.i, self.G * self.there.v)
        self.eq(self.there.i, 0)


def test_a_bus_whose_voltage_nothing_determines(cache: KernelCache) -> None:
    s = System()
    s.add("source", IdealSource())
    s.add("a", Watched())
    s.connect("source.pin", "a.there")
    s.add("b", Watched(G=-1.0))
    s.connect("source.pin", "b.there")
    s.connect("a.here", "b.here")
    text = refused("GF3020", s, cache)
    assert "nothing determines a.here.v" in text
    assert "sum of flows at a.here.v" in text


def test_a_nominal_must_be_positive_and_a_start_finite(cache: KernelCache) -> None:
    class Odd(Storage):
        v = Variable("V", "voltage", nominal=lambda self: self.R - 2.0, start=1.0)

    s = System()
    s.add("source", IdealSource())
    s.add("odd", Odd(R=2.0))
    s.connect("source.pin", "odd.pin")
    assert "Odd: nominal of v must be greater than 0; got 0" in refused("GF2003", s, cache)
    s.components["odd"] = Odd(R=3.0, v=float("nan"))
    assert "Odd: v (start) must be finite; got nan" in refused("GF2002", s, cache)
    s.components["odd"] = Odd(R=3.0)
    assert isinstance(build(s, cache), Built)


def test_a_value_out_of_bounds_is_told_when_the_system_is_built(cache: KernelCache) -> None:
    class Derived(Load):
        R = Parameter("ohm", "resistance", above=0.0, default=lambda self: self.x - 1.0)
        x = Parameter("ohm", "a base", default=0.5)

    s = System()
    s.add("source", IdealSource())
    s.add("load", Derived())
    s.connect("source.pin", "load.pin")
    assert "R must be greater than 0 (resistance, ohm); got -0.5" in refused("GF2003", s, cache)


def test_a_system_with_ac_terminals_pairs_real_with_real(cache: KernelCache) -> None:
    class Rotating(Component):
        """i = j B v: each part of the current belongs to the other part of the voltage."""

        B = Parameter("S", "susceptance", default=2.0)
        ac = AcPort("terminal")

        def equations(self) -> None:
            self.eq(self.ac.ir, -self.B * self.ac.vi)
            self.eq(self.ac.ii, self.B * self.ac.vr)

    class Feed(Component):
        E = Parameter("V", "voltage", default=3.0)
        G = Parameter("S", "conductance", default=1.0)
        ac = AcPort("terminal")

        def equations(self) -> None:
            self.eq(self.ac.ir, self.G * (self.ac.vr - self.E))
            self.eq(self.ac.ii, self.G * self.ac.vi)

    s = System()
    s.add("feed", Feed())
    s.add("load", Rotating())
    s.connect("feed.ac", "load.ac")
    linked = build(s, cache).linked
    v = Assembled(linked).rest()
    expected = 3.0 / (1 + 2j)  # G (v - E) + j B v = 0
    assert v == pytest.approx([expected.real, expected.imag])
