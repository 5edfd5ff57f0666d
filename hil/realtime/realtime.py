"""1 kHz in virtual time: the bridge of a rig on an emulated PC with a real-time kernel, run twice, the same figures.

    python hil/realtime/realtime.py [--periods 5000] [--scenario FILE] [--json FILE]

Exit code 1 if a deadline was missed, a reference did not come, or the two runs differ in a single byte.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import machine

ROOT = Path(__file__).resolve().parents[2]
SCENARIO = ROOT / "cli" / "gustform_cli" / "scenarios" / "load_step_8ms.yaml"
TIMEOUT = 900
"""Seconds of this machine for one run of the other; it takes about 30 on an idle one."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Builds, runs twice, compares, prints."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--periods", type=int, default=5000, help="that are measured (default: 5000)")
    parser.add_argument("--scenario", type=Path, default=SCENARIO, help="whose controller the rig has")
    parser.add_argument("--folder", type=Path, default=ROOT / "build" / "realtime", help="for all that is built")
    parser.add_argument("--json", type=Path, help="file for the figures")
    options = parser.parse_args(arguments)
    try:
        linux = machine.kernel(options.folder / "kernel")
        bridge = rig(options.scenario, options.folder / "rig")
        peer = compiled_peer(options.folder / "rig", options.folder / "peer")
        files = machine.with_libraries([bridge, peer])
        command = ["peer", "vcan0", str(options.periods), f"/bin/{bridge.name}", "--interface", "vcan0"]
        runs = []
        for number in (1, 2):
            print(f"   run {number} of 2 on {linux.version}", flush=True)
            runs.append(machine.run(linux, options.folder / f"run{number}", command, files, TIMEOUT))
    except machine.Failed as reason:
        print(f"hil-realtime: {reason}", file=sys.stderr)
        return 1
    return judge(runs, linux, options.periods, options.json)


def rig(scenario: Path, folder: Path) -> Path:
    """The program of a fresh rig: `gustform hil build`."""
    gustform = Path(sys.executable).with_name("gustform")
    machine.output(str(gustform), "hil", "build", str(scenario), "--out", str(folder))
    return folder / "build" / "gust-bridge"


def compiled_peer(folder: Path, program: Path) -> Path:
    """The other end of the bus, with the message set of the rig."""
    sources = [Path(__file__).with_name("peer.c"), *sorted(folder.glob("messages/*.c"))]
    sources += [folder / "bridge" / "src" / name for name in ("messages.c", "e2e.c")]
    includes = [f"-I{folder / part}" for part in ("bridge/include", "bridge/src", "messages")]
    machine.output("cc", "-std=c11", "-O2", *includes, *map(str, sources), "-lm", "-o", str(program))
    return program


def events(outcome: machine.Outcome) -> dict[str, dict[str, Any]]:
    """The JSON lines of a run by their event, the last of each."""
    lines = [json.loads(line) for line in outcome.stdout.splitlines() if line.startswith("{")]
    return {line["event"]: line for line in lines}


def judge(runs: Sequence[machine.Outcome], linux: machine.Kernel, periods: int, target: Path | None) -> int:
    """Prints the table; 1 if anything was late, lost or different."""
    first = runs[0]
    said = events(first)
    if "end" not in said or "peer" not in said:
        print(f"hil-realtime: the run did not end:\n{first.stdout}{first.stderr}", file=sys.stderr)
        return 1
    start, end, peer = said["start"], said["end"], said["peer"]
    same = all(run == first for run in runs)
    rows = [
        ("periods measured", peer["periods"]),
        ("deadlines missed, of all periods", f"{end['missed']} of {end['periods']}"),
        ("periods without references", peer["missing"]),
        ("lateness of the bridge, median / p99 / max", quantiles(end["lateness_us"])),
        ("lateness of the peer, mean / p99 / max", spread(peer["late_us"])),
        ("deadline to references sent, median / p99 / max", quantiles(end["response_us"])),
        ("Sync to references on the bus, mean / p99 / max", spread(peer["sync_to_references_us"])),
        ("deviation of their interval from 1 ms, mean / p99 / max", spread(peer["jitter_us"])),
        ("SCHED_FIFO, locked memory", f"{start['real_time']}, {start['locked']}"),
        ("both runs the same, byte for byte", same),
    ]
    width = max(len(name) for name, _ in rows)
    print(f"{start['controller']} at 1 kHz in virtual time, {2**machine.SHIFT} ns an instruction, {linux.version}:")
    print("\n".join(f"  {name:<{width}}  {value}" for name, value in rows))
    good = same and all(run.code == 0 for run in runs) and start["real_time"] and start["locked"]
    good = good and end["missed"] == 0 and peer["missing"] == 0 and peer["periods"] == periods
    if target is not None:
        figures = {"good": good, "same": same, "kernel": linux.version, "start": start, "end": end, "peer": peer}
        target.write_text(json.dumps(figures, indent=2) + "\n")
    if not good:
        print(f"hil-realtime: not as it has to be:\n{runs[-1].stdout}{runs[-1].stderr}", file=sys.stderr)
    return 0 if good else 1


def spread(times: dict[str, float]) -> str:
    """Three times in one cell."""
    return "{mean:.1f} / {p99:.1f} / {max:.1f} us".format_map(times)


def quantiles(times: dict[str, float]) -> str:
    """The same of the bridge's own statistics, in whole microseconds."""
    return "{median} / {p99} / {max} us".format_map(times)


if __name__ == "__main__":
    sys.exit(main())
