"""libFuzzer under AddressSanitizer and UBSan, on decoder, bridge and converter: a minute here, long in `make fuzz`.

What it learns is kept in build/fuzz/<target>; seeds are frames of the message sets. GUSTFORM_FUZZ_SECONDS: how long,
each of the six targets.
"""

from __future__ import annotations

import os
import re
import shutil
import struct
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

from gustform_codegen.emit.controller.description import stable_id
from gustform_codegen.emit.controller.folder import write_folder
from gustform_hil.codec import Codec
from gustform_hil.database import BUSES, shipped
from gustform_hil.locate import bridge_folder
from gustform_hil.message_set import Field, Message, MessageSet, Part
from tests.support.controller import PREFIX, program_of
from tests.support.message_library import WARNINGS, includes, sources

HERE = Path(__file__).resolve().parent
BUILD = HERE.parent.parent / "build" / "fuzz"
SECONDS = int(os.environ.get("GUSTFORM_FUZZ_SECONDS", "10"))
SANITIZERS = ["-fsanitize=fuzzer,address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
PLANTED = 20  # s, at most, for what a fuzzer that works finds in less than one


def build(messages: MessageSet, target: str, folder: Path, *more: str) -> Path:
    """The fuzzer of a target. A folder of one's own: several run at a time."""
    clang = shutil.which("clang")
    assert clang, "no clang; tools/system_packages.sh --tests installs it"
    files = [HERE / f"{target}.c", *sources(messages, folder)]
    program = folder / target
    command = [clang, "-g", "-O1", "-ffp-contract=off", *SANITIZERS, *WARNINGS, *includes(folder), *more]
    done = subprocess.run(
        [*command, *map(str, files), "-o", str(program), "-lm"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return program


def fuzz(program: Path, seeds: Path, corpus: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run it. The artifacts of a crash are left in the folder of the corpus, for the next run to begin with."""
    corpus.mkdir(parents=True, exist_ok=True)
    command = [str(program), f"-artifact_prefix={corpus}/", "-print_final_stats=1", *options, str(corpus), str(seeds)]
    # Frames are short; the defaults of libFuzzer are made for files.
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=SECONDS + 240)


def executed(done: subprocess.CompletedProcess[str]) -> int:
    line = next(line for line in done.stderr.splitlines() if "stat::number_of_executed_units" in line)
    return int(line.split()[-1])


def values_of(message: Message, fields: Mapping[Field, float]) -> dict[str, float]:
    return {s.name: fields.get(s.field, s.safe) for s in message.signals}


def decoder_seeds(messages: MessageSet, folder: Path) -> None:
    """A good frame of each message, and one that is taken as it is, without its CRC made right."""
    codec = Codec(messages)
    folder.mkdir()
    for number, message in enumerate(messages.messages):
        for operation in message.multiplexer_values or (0,):
            data = codec.encode(message, values_of(message, {Field.OPERATION: float(operation)}), 3)
            for head in (0xC0, 0x00 if not message.fd else 0x01):
                name = f"{message.name}_{operation}_{head:02x}"
                (folder / name).write_bytes(struct.pack("<BH", head, number) + data)


class Script:
    """Records for the bridge's target."""

    def __init__(self, messages: MessageSet, options: int) -> None:
        self.messages, self.codec = messages, Codec(messages)
        self.data = bytearray([options])

    def send(self, part: Part, fields: Mapping[Field, float]) -> None:
        for message in self.messages.pieces(part):
            number = self.messages.messages.index(message)
            self.data += bytes([1, number]) + self.codec.encode(message, values_of(message, fields), 0)

    def sampled(self, part: Part, sample: int, enable: int = 0) -> None:
        """A part with a number of a sample, modulo what its bits carry."""
        number = self.messages.pieces(part)[0].signal(Field.SAMPLE)
        assert number is not None
        self.send(part, {Field.SAMPLE: sample % (number.high + 1), Field.ENABLE: enable})

    def period(self, sample: int) -> None:
        self.sampled(Part.MEASUREMENTS, sample)
        self.send(Part.SYNC, {Field.SAMPLE: sample})
        if self.data[0] & 1 == 0:
            self.data.append(0)


def bridge_script(messages: MessageSet, options: int, until: str, parameter: int) -> bytes:
    """From the first frame to READY, to RUN, or over SAFE back to RUN."""
    script = Script(messages, options)
    script.send(Part.CONVERTER_FINGERPRINT, {Field.FINGERPRINT: messages.fingerprint})
    script.send(Part.CONVERTER_HEARTBEAT, {})
    script.send(Part.CONVERTER_STATE, {Field.STATE: 1})
    for sample in range(6):
        script.period(sample)
    if until != "ready":
        script.send(Part.OPERATOR_COMMAND, {Field.COMMAND: 1, Field.NONCE: 1})
        for sample in range(6, 12):
            script.send(Part.CONVERTER_STATE, {Field.STATE: 2})
            script.period(sample)
    if until == "parameter":
        for operation in (0, 1, 2):
            script.send(
                Part.PARAMETER_REQUEST, {Field.OPERATION: operation, Field.PARAMETER: parameter, Field.VALUE: 0.5}
            )
            script.period(12 + operation)
    if until == "back":  # an emergency stop, a reset after some quiet periods, and once more to RUN
        script.send(Part.EMERGENCY_STOP, {Field.COMMAND: 1})
        script.send(Part.CONVERTER_STATE, {Field.STATE: 1})
        for sample in range(12, 18):
            script.period(sample)
        script.send(Part.OPERATOR_COMMAND, {Field.COMMAND: 3, Field.NONCE: 2})
        for sample in range(18, 26):
            script.period(sample)
        script.send(Part.OPERATOR_COMMAND, {Field.COMMAND: 1, Field.NONCE: 3})
        for sample in range(26, 30):
            script.period(sample)
    return bytes(script.data)


def bridge_seeds(messages: MessageSet, folder: Path, program: Path) -> None:
    folder.mkdir()
    parameter = stable_id("parameters", program_of("DualPort").step.parameters[0].name)
    for options in range(4):
        for until, state in (("ready", 1), ("run", 2), ("parameter", 2), ("back", 2)):
            seed = folder / f"{until}_{options}"
            seed.write_bytes(bridge_script(messages, options, until, parameter))
            assert f"state {state}" in told(program, seed), f"{seed.name} does not get where it should"


def told(program: Path, seed: Path) -> str:
    """What state the end of a seed finds."""
    tell = {**os.environ, "GUST_FUZZ_TELL": "1"}
    done = subprocess.run([str(program), str(seed)], capture_output=True, text=True, check=True, env=tell)
    return done.stdout


def plant_seeds(messages: MessageSet, folder: Path, program: Path) -> None:
    """Running, and tripped by an emergency stop or by a bridge of another database."""
    folder.mkdir()
    for name, state in (("running", 2), ("stopped", 3), ("stranger", 3), ("blocked", 1)):
        script = Script(messages, 0)
        del script.data[0]
        for sample in range(8):
            script.data.append(0)
            script.send(Part.CONTROLLER_FINGERPRINT, {Field.FINGERPRINT: messages.fingerprint})
            script.sampled(Part.REFERENCES, sample, enable=int(name != "blocked"))
        if name == "stopped":
            script.send(Part.EMERGENCY_STOP, {Field.COMMAND: 1})
        if name == "stranger":
            script.send(Part.CONTROLLER_FINGERPRINT, {Field.FINGERPRINT: 1})
            script.data.append(0)
        (folder / name).write_bytes(script.data)
        assert f"state {state}" in told(program, folder / name), f"{name} does not get where it should"


def core() -> list[Path]:
    """The sources of the bridge that know no operating system, as its CMakeLists.txt names them."""
    found = re.search(r"set\(GUST_BRIDGE_CORE ([a-z0-9_ ]+)\)", (bridge_folder() / "CMakeLists.txt").read_text())
    assert found
    others = set(found[1].split()) - {"e2e", "messages"}  # those come with the message set
    return [bridge_folder() / "src" / f"{name}.c" for name in sorted(others)]


def bridge_program(messages: MessageSet, folder: Path, *more: str) -> Path:
    """The bridge's core around the exported dual-port control, in float as on a microcontroller."""
    controller = folder / "controller"
    write_folder(program_of("DualPort"), PREFIX, False, controller)
    extra = [
        *map(str, core()),
        str(controller / f"{PREFIX}.c"),
        str(controller / f"{PREFIX}_interface.c"),
        f"-I{controller}",
    ]
    return build(messages, "bridge", folder, f"-DGUST_FUZZ_CONTROLLER={PREFIX}_controller", *extra, *more)


@pytest.mark.parametrize("bus", BUSES)
def test_the_decoder_withstands_any_frame(tmp_path: Path, bus: str) -> None:
    messages = shipped(bus)
    program = build(messages, "decode", tmp_path)
    decoder_seeds(messages, tmp_path / "seeds")
    corpus = BUILD / f"decode_{bus}"
    done = fuzz(program, tmp_path / "seeds", corpus, f"-max_total_time={SECONDS}", "-max_len=96")
    assert done.returncode == 0, done.stderr[-4000:]
    assert executed(done) > 1000 * SECONDS, done.stderr[-2000:]


@pytest.mark.parametrize("bus", BUSES)
def test_the_bridge_withstands_any_sequence(tmp_path: Path, bus: str) -> None:
    messages = shipped(bus)
    program = bridge_program(messages, tmp_path)
    bridge_seeds(messages, tmp_path / "seeds", program)
    corpus = BUILD / f"bridge_{bus}"
    done = fuzz(program, tmp_path / "seeds", corpus, f"-max_total_time={SECONDS}", "-max_len=4096")
    assert done.returncode == 0, done.stderr[-4000:]
    assert executed(done) > 10 * SECONDS, done.stderr[-2000:]


@pytest.mark.parametrize("bus", BUSES)
def test_the_converters_node_withstands_any_sequence(tmp_path: Path, bus: str) -> None:
    messages = shipped(bus)
    controller = tmp_path / "controller"  # for its header
    write_folder(program_of("DualPort"), PREFIX, False, controller)
    program = build(messages, "plant", tmp_path, *map(str, core()), f"-I{controller}")
    plant_seeds(messages, tmp_path / "seeds", program)
    corpus = BUILD / f"plant_{bus}"
    done = fuzz(program, tmp_path / "seeds", corpus, f"-max_total_time={SECONDS}", "-max_len=4096")
    assert done.returncode == 0, done.stderr[-4000:]
    assert executed(done) > 10 * SECONDS, done.stderr[-2000:]


@pytest.mark.parametrize(
    ("sound", "broken"),
    [
        ("result = GUST_OUT_OF_RANGE;", "result = GUST_DECODED;"),
        ("if (!m->unpack(frame->data, found))", "if (!m->unpack(frame->data + 40, found))"),
    ],
)
def test_a_planted_defect_is_found(tmp_path: Path, sound: str, broken: str) -> None:
    source = tmp_path / "src"
    shutil.copytree(bridge_folder() / "src", source)
    text = (source / "messages.c").read_text()
    assert sound in text
    (source / "messages.c").write_text(text.replace(sound, broken))
    messages = shipped("fd")
    clang = shutil.which("clang") or "clang"
    files = [HERE / "decode.c", *(f for f in sources(messages, tmp_path) if f.name != "messages.c")]
    command = [clang, "-g", "-O1", *SANITIZERS, *includes(tmp_path), *map(str, files), str(source / "messages.c")]
    subprocess.run([*command, "-o", str(tmp_path / "decode"), "-lm"], check=True, capture_output=True)
    decoder_seeds(messages, tmp_path / "seeds")
    options = (f"-max_total_time={PLANTED}", "-max_len=96")
    done = fuzz(tmp_path / "decode", tmp_path / "seeds", tmp_path / "corpus", *options)
    assert done.returncode != 0, "the fuzzer has not seen it"
