"""`gustform hil budget` on the command line, and the numbers that hil/README.md shows."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gustform_cli.main import app

ROOT = Path(__file__).resolve().parents[3]


def budget(*arguments: str) -> tuple[int, str, str]:
    done = CliRunner().invoke(app, ["hil", "budget", *arguments])
    return done.exit_code, done.stdout, done.stderr


def test_the_table_and_its_exit_code() -> None:
    code, out, _ = budget("--data-bitrate", "2M")
    assert code == 0
    assert out.startswith("gustform_fd at 500 kbit/s, data 2 Mbit/s: load 8")
    assert re.search(r"^References +0x110 +CTRL +48 +321\.0 +1 +0\.99\d +100%$", out, flags=re.MULTILINE)
    code, out, error = budget("--bus", "classic", "--bitrate", "500k")
    assert code == 1
    assert "no bound         late" in out
    assert error.startswith("error GF8121: gustform_classic needs 11")
    assert error.rstrip().endswith("try --bitrate 1M")


def test_json_says_the_same() -> None:
    code, out, _ = budget("--bus", "classic", "--json")
    found = json.loads(out)
    assert (code, found["fits"], found["bitrate"], found["data_bitrate"]) == (0, True, 1_000_000, None)
    assert found["load"] == pytest.approx(sum(m["frame_s"] / m["period_s"] for m in found["messages"]))
    assert all(m["frame_s"] <= m["response_s"] <= m["deadline_s"] for m in found["messages"])


def test_all_rates() -> None:
    code, out, _ = budget("--all", "--json")
    fits = {(one["bitrate"], one["data_bitrate"]) for one in json.loads(out) if one["fits"]}
    assert code == 0
    assert {(500_000, 2_000_000), (500_000, 5_000_000), (1_000_000, 5_000_000)} <= fits
    assert (500_000, 1_000_000) not in fits
    assert "500 kbit/s   2 Mbit/s" in budget("--all")[1]


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (("--bitrate", "fast"), "GF8120"),
        (("--bitrate", "0"), "GF8120"),
        (("--bitrate", "500.0001"), "GF8120"),
        (("--data-bitrate", "100k"), "GF8120"),
        (("--jitter", "-1"), "GF8123"),
        (("--event-distance", "nan"), "GF8123"),
        (("--errors-every", "5 V"), "GF2302"),
        (("--dbc", "nowhere.dbc"), "GF8001"),
        (("--fifo", "NOBODY"), "GF8125"),
        (("--fifo", "CTRL", "--fifo", "CTRL+OPER"), "GF8125"),
    ],
)
def test_what_is_refused(arguments: tuple[str, ...], code: str) -> None:
    exit_code, _, error = budget(*arguments)
    assert (exit_code, code in error) == (2, True), error


def test_a_long_frame_that_is_not_fd_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "long.dbc"
    file.write_text('VERSION ""\nBU_: A\nBO_ 1 Long: 12 A\n SG_ s : 0|8@1+ (1,0) [0|255] "" A\n')
    exit_code, _, error = budget("--dbc", str(file))
    assert (exit_code, "GF8124: Long has 12 bytes" in error) == (2, True), error


def test_a_plain_queue_is_said_and_counts() -> None:
    code, out, error = budget("--fifo", "CTRL", "--data-bitrate", "2M")
    assert code == 1
    assert "GF8122: References of gustform_fd may take 1.1" in error
    assert error.rstrip().endswith("try --bitrate 500k --data-bitrate 4M")
    assert "CTRL: a plain queue" in out
    assert "the bridge sends one of its slow messages in each period" in out
    code, text, _ = budget("--fifo", "CTRL", "--fifo", "OPER", "--json")
    found = json.loads(text)
    assert (code, found["fifo"], found["fits"]) == (0, [["CTRL"], ["OPER"]], True)
    messages = {m["name"]: m for m in found["messages"]}
    assert messages["References"]["paced_s"] is None
    state, references = messages["ControllerState"], messages["References"]
    # Three others may be first, one in each period; then it has its turn, and the fate of the queue.
    assert state["paced_s"] == 1e-3
    assert state["response_s"] == pytest.approx(3e-3 + references["response_s"], abs=2e-6)
    # On one interface references wait for the operator's frames as well.
    _, text, _ = budget("--fifo", "CTRL+OPER", "--json")
    shared = {m["name"]: m for m in json.loads(text)["messages"]}
    assert shared["References"]["response_s"] > references["response_s"] + 3e-4


def test_jitter_and_errors_are_said() -> None:
    _, out, _ = budget("--data-bitrate", "5M", "--jitter", "50 us", "--errors-every", "100 ms")
    assert "each frame up to 0.05 ms late" in out
    assert "at most one error on the wire per 100 ms" in out


def test_the_bench_readme_shows_these_numbers() -> None:
    rows = re.findall(r"^\| (FD|classic), (.*?) \| . ms \| (.*?) % \| (\d+) us \| (.*?) ms \| (.*?) ms(?:, late)? \|$",
                      (ROOT / "hil" / "README.md").read_text(), flags=re.MULTILINE)  # fmt: skip
    assert len(rows) == 4
    for kind, rates, load, cyclic, response, in_plain_queue in rows:
        nominal, _, data = (rate.replace(" kbit/s", "k").replace(" Mbit/s", "M") for rate in rates.partition(", data "))
        of_data = ["--data-bitrate", data] if data else []
        words = ["--bus", kind.lower(), "--bitrate", nominal, *of_data, "--json"]
        found, queued = (json.loads(budget(*words, *more)[1]) for more in ((), ("--fifo", "CTRL", "--fifo", "OPER")))
        messages, same = (
            [m for m in one["messages"] if re.match("Sync|Measurements|References", m["name"])]
            for one in (found, queued)
        )
        assert f"{100 * found['load']:.1f}" == load, rates
        assert 1e6 * sum(m["frame_s"] for m in messages) == pytest.approx(int(cyclic), abs=0.51), rates
        assert f"{1e3 * messages[-1]['response_s']:.3f}" == response, rates
        assert f"{1e3 * same[-1]['response_s']:.3f}" == in_plain_queue, rates
