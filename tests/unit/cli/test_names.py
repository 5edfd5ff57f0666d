"""Which of several names a channel is recorded under."""

from __future__ import annotations

from gustform_cli.names import expand, short_aliases, with_best_names
from gustform_codegen.table import Channel


def test_patterns_reach_all_instances() -> None:
    assert expand("wt.*", {"wt": 3}) == "wt[*].*"
    assert expand("wt[2].*", {"wt": 3}) == "wt[2].*"
    assert expand("*.omega_r", {"wt": 3}) == "*.omega_r"
    assert expand("sg.frequency", {"wt": 3}) == "sg.frequency"


def test_the_name_nearest_to_the_top_wins() -> None:
    channels = [Channel("wt.pitch.servo.beta", "deg", "", 0, 0, 0), Channel("sg.machine.omega", "pu", "", 0, 1, 0)]
    aliases = {
        "wt.beta": ("wt.pitch.servo.beta", 1),
        "wt.rotor.beta": ("wt.pitch.servo.beta", 1),
        "wt.minus_beta": ("wt.pitch.servo.beta", -1),
        "sg.frame": ("sg.machine.omega", 1),
        "sg.omega": ("sg.machine.omega", 1),
    }
    renamed, table = with_best_names(channels, aliases, inputs={"sg.frame"})
    assert [channel.name for channel in renamed] == ["wt.beta", "sg.omega"]
    assert table == {
        "wt.pitch.servo.beta": ("wt.beta", 1),
        "wt.rotor.beta": ("wt.beta", 1),
        "wt.minus_beta": ("wt.beta", -1),
        "sg.machine.omega": ("sg.omega", 1),
        "sg.frame": ("sg.omega", 1),
    }


def test_instances_share_their_aliases() -> None:
    aliases = {f"wt[{n}].a": (f"wt[{n}].b", -1) for n in (1, 2)} | {"sg.a": ("sg.b", 1)}
    assert short_aliases(aliases, {"wt": 2}) == {"sg.a": ["sg.b", 1], "wt.a": ["wt.b", -1]}
