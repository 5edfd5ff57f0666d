"""Bring your own database: other names, Motorola byte order, 29-bit identifiers, own scaling, mapped and closed."""

from __future__ import annotations

import ctypes
import random
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import cantools.database
import pytest

from gustform.language.errors import ErrorList, GustformError
from gustform_hil.c_messages import c_messages
from gustform_hil.codec import Codec, Problem
from gustform_hil.database import load_message_set
from gustform_hil.message_set import Field, MessageSet, Part
from tests.support.message_library import EXTENDED, WARNINGS, MessageLibrary, Status, compiler, flags_of

# As a converter maker's might be: J1939-like identifiers, volts and per mille, a trip code, a multiplexed service
# channel, one frame without protection, one of profile 1, a message of no concern here.
DBC = """VERSION ""
NS_ :
BS_:
BU_: INV PLC

BO_ 2566869761 INV_Meas1: 8 INV
 SG_ ChkSum : 7|8@0+ (1,0) [0|0] "" PLC
 SG_ AliveCnt : 11|4@0+ (1,0) [0|14] "" PLC
 SG_ CycleNo : 15|4@0+ (1,0) [0|15] "" PLC
 SG_ Udc : 23|16@0+ (0.05,0) [0|2400] "V" PLC
 SG_ dUdc : 39|16@0- (40,0) [-1200000|1200000] "V/s" PLC
 SG_ RotSpeed : 55|12@0- (0.001,0.3) [-0.1|2] "pu" PLC
 SG_ NotUsed : 59|4@0+ (1,0) [0|15] "" PLC

BO_ 2566870017 INV_Meas2: 8 INV
 SG_ ChkSum : 7|8@0+ (1,0) [0|0] "" PLC
 SG_ AliveCnt : 11|4@0+ (1,0) [0|14] "" PLC
 SG_ CycleNo : 15|4@0+ (1,0) [0|15] "" PLC
 SG_ QgridPerMille : 19|12@0- (1,0) [-2000|2000] "per mille" PLC
 SG_ Qgen : 39|32@0- (1,0) [-3|3] "pu" PLC

BO_ 2566870273 PLC_Ref: 8 PLC
 SG_ ChkSum : 7|8@0+ (1,0) [0|0] "" INV
 SG_ AliveCnt : 11|4@0+ (1,0) [0|14] "" INV
 SG_ CycleNo : 15|4@0+ (1,0) [0|15] "" INV
 SG_ FreqRef : 16|16@1+ (0.001,0) [25|75] "Hz" INV
 SG_ PitchRef : 39|16@0- (-0.01,0) [-90|10] "deg" INV
 SG_ Release : 48|1@1+ (1,0) [0|1] "" INV

BO_ 2566870529 PLC_Cmd: 2 PLC
 SG_ Button : 0|3@1+ (1,0) [0|7] "" INV
 SG_ Press : 8|8@1+ (1,0) [0|255] "" INV

BO_ 2566870785 SVC: 8 PLC
 SG_ Op M : 0|8@1+ (1,0) [0|255] "" INV
 SG_ Par : 8|16@1+ (1,0) [0|65535] "" INV
 SG_ Val m1 : 32|32@1- (1,0) [-1000000|1000000] "" INV
 SG_ Other m7 : 32|32@1- (1,0) [0|0] "" INV

BO_ 100 Unrelated: 8 INV
 SG_ Overlaps : 0|16@1+ (1,0) [0|0] "" PLC
 SG_ Overlapped : 8|16@1+ (1,0) [0|0] "" PLC

BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;
BA_DEF_DEF_ "GenMsgCycleTime" 10;
SIG_VALTYPE_ 2566870017 Qgen : 1;
SIG_VALTYPE_ 2566870785 Val : 1;
SIG_VALTYPE_ 2566870785 Other : 1;
"""

MAPPING = """
name: maker
messages:
  INV_Meas1:
    part: measurements
    piece: 0
    e2e: {profile: 1, data_id: 0x0A11}
    signals:
      CycleNo: sample
      Udc: {quantity: v_dc, base: 1200, safe: 1}
      dUdc: {quantity: dv_dc, base: 1200}
      RotSpeed: {quantity: omega_r}
  INV_Meas2:
    part: measurements
    piece: 1
    e2e: {profile: 1, data_id: 0x0A12}
    signals:
      CycleNo: sample
      QgridPerMille: {quantity: Q_gsc, base: 1000}
      Qgen: {quantity: Q_msc}
  PLC_Ref:
    part: references
    cycle: 5
    e2e: {profile: 1, data_id: 0x0B01}
    signals:
      CycleNo: sample
      FreqRef: {quantity: omega_gsc, base: 50, safe: 1}
      PitchRef: {quantity: beta_ref, base: -1, safe: 90}
      Release: enable
  PLC_Cmd:
    part: operator_command
    cycle: 0
    signals:
      Button: command
      Press: nonce
  SVC:
    part: parameter_request
    signals:
      Op: operation
      Par: parameter
      Val: value
"""


@pytest.fixture(scope="module")
def messages(tmp_path_factory: pytest.TempPathFactory) -> MessageSet:
    folder = tmp_path_factory.mktemp("maker")
    # As Windows tools write it: CRLF and a sign that is no ASCII.
    (folder / "maker.dbc").write_bytes(DBC.replace("\n", "\r\n").replace("per mille", "\u2030").encode("cp1252"))
    (folder / "mapping.yaml").write_text(MAPPING)
    return load_message_set(folder / "maker.dbc", folder / "mapping.yaml")


def test_values_are_in_the_units_of_the_controller(messages: MessageSet) -> None:
    first = messages.find(Part.MEASUREMENTS, 0)
    references = messages.find(Part.REFERENCES)
    assert first is not None
    assert references is not None
    assert (first.id, first.extended, first.fd) == (2566869761 & 0x1FFFFFFF, True, False)
    assert (first.cycle, references.cycle) == (10_000, 5_000)
    v_dc = first.signal(Field.QUANTITY, "v_dc")
    beta = references.signal(Field.QUANTITY, "beta_ref")
    assert v_dc is not None
    assert beta is not None
    assert (v_dc.unit, v_dc.low, v_dc.safe) == ("pu", 0.0, 1.0)
    assert v_dc.high == pytest.approx(2.0)
    assert v_dc.scale == pytest.approx(0.05 / 1200)
    # The maker counts pitch the other way round: the range turns around with it.
    assert beta.low == pytest.approx(-10.0)
    assert beta.high == pytest.approx(90.0)
    assert beta.safe == 90.0


def test_the_loop_closes_over_c_cantools_and_the_file(messages: MessageSet, tmp_path: Path) -> None:
    c, codec = MessageLibrary(messages, tmp_path), Codec(messages)
    direct: Any = cantools.database.load_string(DBC, "dbc", strict=False)
    bases = {"Udc": 1200.0, "dUdc": 1200.0, "QgridPerMille": 1000.0, "FreqRef": 50.0, "PitchRef": -1.0}
    rng = random.Random(3)
    for message in messages.messages:
        for counter in range(60):
            operation = rng.choice(message.multiplexer_values or (0,))
            there = list(message.active(operation))
            values = {s.name: rng.uniform(s.low - 0.1 * abs(s.low), 1.1 * s.high) for s in there}
            values |= {s.name: float(operation) for s in there if s.field == Field.OPERATION}
            data, cut = c.encode(message, values, counter)
            assert data == codec.encode(message, values, counter)
            assert cut == {s.name for s in there if not s.low <= values[s.name] <= s.high}
            decoded = c.decode(message.id, data, flags_of(message))
            assert decoded.status == Status.DECODED
            assert decoded.counter == (counter % 15 if message.e2e.profile else 0)
            # The database itself, in the maker's units.
            theirs = direct.get_message_by_name(message.name).decode(data, decode_choices=False)
            for signal in there:
                expected = theirs[signal.name] / bases.get(signal.name, 1.0)
                assert decoded.values[signal.name] == pytest.approx(expected, rel=1e-12, abs=1e-12)
                wanted = min(max(values[signal.name], signal.low), signal.high)
                step = abs(signal.scale) if not signal.real else abs(wanted) * 2.0**-23
                assert abs(decoded.values[signal.name] - wanted) <= 0.5 * step * (1 + 1e-9)


def test_what_is_not_mapped_is_neither_read_nor_sent(messages: MessageSet, tmp_path: Path) -> None:
    c, codec = MessageLibrary(messages, tmp_path), Codec(messages)
    message = messages.by_name["INV_Meas1"]
    data = bytearray(codec.encode(message, {s.name: s.safe for s in message.signals}, 3))
    data[7] |= 0x0F  # NotUsed
    codec.protect(message, data, 3)
    assert c.decode(message.id, bytes(data), EXTENDED).status == Status.DECODED
    assert c.decode(100, bytes(8), 0).status == Status.UNKNOWN_ID
    assert "NotUsed" not in {s.name for s in message.signals}


def test_without_a_counter_each_frame_is_the_next_one(messages: MessageSet, tmp_path: Path) -> None:
    c = MessageLibrary(messages, tmp_path)
    assert [c.ahead(messages.by_name["PLC_Cmd"], last, 7) for last in (0, 7, 255)] == [1, 1, 1]
    # Profile 1 counts 0 ... 14.
    counted = messages.by_name["PLC_Ref"]
    assert [c.ahead(counted, 14, counter) for counter in (14, 0, 1, 13)] == [0, 1, 2, 14]


def test_operations_of_others_are_unknown(messages: MessageSet, tmp_path: Path) -> None:
    c, codec = MessageLibrary(messages, tmp_path), Codec(messages)
    message = messages.by_name["SVC"]
    assert message.multiplexer_values == (1,)  # the database knows 1 and 7; 7 is nothing that the bridge could do
    for operation, status in ((1, Status.DECODED), (7, Status.UNKNOWN_MULTIPLEXER), (0, Status.UNKNOWN_MULTIPLEXER)):
        data = bytes([operation]) + bytes(7)
        assert c.decode(message.id, data, EXTENDED).status == status
        theirs = codec.decode(message.id, data, fd=False, extended=True).problem
        assert theirs == (Problem.UNKNOWN_MULTIPLEXER if status else None)


def test_the_same_input_gives_the_same_bytes_without_a_date(messages: MessageSet) -> None:
    first, second = c_messages(messages), c_messages(messages)
    assert first == second
    assert list(first) == ["maker.h", "maker.c", "gust_message_set.c"]
    for text in first.values():
        assert text.isascii()
        assert not any(day in text for day in (" Mon ", " Tue ", " Wed ", " Thu ", " Fri ", " Sat ", " Sun "))


def test_no_object_has_writable_data(messages: MessageSet, tmp_path: Path) -> None:
    # Tables are const: on a microcontroller they stay in flash.
    for name, text in c_messages(messages).items():
        (tmp_path / name).write_text(text)
    include = Path(__file__).resolve().parents[3] / "hil" / "bridge" / "include"
    for name in ("maker.c", "gust_message_set.c"):
        command = [compiler(), "-c", "-Os", *WARNINGS, f"-I{tmp_path}", f"-I{include}", str(tmp_path / name)]
        subprocess.run([*command, "-o", str(tmp_path / "object.o")], check=True)
        sizes = subprocess.run(["size", str(tmp_path / "object.o")], capture_output=True, text=True, check=True)
        _, data, bss, *_ = sizes.stdout.splitlines()[1].split()
        # Pointers in const tables of a position-independent object count as data until it is linked.
        assert bss == "0", sizes.stdout
        assert data == "0" or name == "gust_message_set.c", sizes.stdout


ENTRY = "SIG_VALTYPE_ 2566870017"  # something goes before it
SPANS = ", ".join(["0-4000"] * 999)

REFUSED: dict[str, tuple[str, str]] = {
    "a frame of a gigabyte": ("INV_Meas1: 8 INV", "INV_Meas1: 1000000000 INV"),
    "a frame of a gigabyte behind a comment": ("INV_Meas1: 8 INV", "INV_Meas1//\n: 1000000000 INV"),
    "a frame of a gigabyte without spaces": ("BO_ 100 Unrelated: 8", "BO_+100Unrelated:1000000000"),
    "a frame of 1e9 bytes": ("INV_Meas1: 8 INV", "INV_Meas1: 1e9 INV"),
    "a frame of -1 bytes": ("INV_Meas1: 8 INV", "INV_Meas1: -1 INV"),
    "a signal of a gigabit": ("Udc : 23|16@0+", "Udc : 23|1000000000@0+"),
    "a signal far out": ("Udc : 23|16@0+", "Udc : 1000000000|16@0+"),
    "a signal of no bits": ("Udc : 23|16@0+", "Udc : 23|0@0+"),
    "all multiplexer values": (ENTRY, f"SG_MUL_VAL_ 2566870785 Val Op 0-4000000000;\n{ENTRY}"),
    "many spans of values": (ENTRY, f"SG_MUL_VAL_ 2566870785 Val Op {SPANS};\n{ENTRY}"),
    "a factor beyond doubles": ("(0.05,0)", "(1e999,0)"),
    "an offset beyond doubles": ("(0.05,0)", "(0.05,-1e999)"),
    "an identifier of 40 bits": ("BO_ 2566869761", "BO_ 1000000000000"),
    "a number of 5000 digits": ("BO_ 100 Unrelated", f"BO_ {'9' * 5000} Unrelated"),
    "a unit with a quote": ('"V/s"', '"V"); system("true"'),
    "no DBC": (DBC, "\x7fELF"),
    "nothing": (DBC, ""),
}
HARMLESS: dict[str, tuple[str, str]] = {
    "a unit that ends a comment": ('"per mille"', '"*/ int evil; /*"'),
    "a unit with quotes and lines": ('"per mille"', '"\\");\nint evil = (\\""'),
    "a comment that ends a comment": (ENTRY, f'CM_ BO_ 2566870017 "*\\\n/ int evil;";\n{ENTRY}'),
    "a sender of any name": ("INV_Meas1: 8 INV", "INV_Meas1: 8 int_evil"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_a_hostile_database_is_refused(tmp_path: Path, what: str) -> None:
    old, new = REFUSED[what]
    assert old in DBC
    (tmp_path / "maker.dbc").write_text(DBC.replace(old, new))
    (tmp_path / "mapping.yaml").write_text(MAPPING)
    with pytest.raises((GustformError, ErrorList), match="GF80"):
        load_message_set(tmp_path / "maker.dbc", tmp_path / "mapping.yaml")


@pytest.mark.parametrize("what", HARMLESS)
def test_texts_of_a_database_never_become_code(tmp_path: Path, what: str) -> None:
    old, new = HARMLESS[what]
    assert old in DBC
    (tmp_path / "maker.dbc").write_text(DBC.replace(old, new))
    (tmp_path / "mapping.yaml").write_text(MAPPING)
    messages = load_message_set(tmp_path / "maker.dbc", tmp_path / "mapping.yaml")
    assert not any("evil" in text for text in c_messages(messages).values())
    MessageLibrary(messages, tmp_path)


def test_the_unit_of_a_parameter_is_escaped(messages: MessageSet, tmp_path: Path) -> None:
    # The only text of a database that is printed, as a string: of what is not the controller's own.
    unit = '"};\n/* */ \\ ??/ %n é'
    parts = [
        replace(m, signals=tuple(replace(s, unit=unit) if s.field == Field.VALUE else s for s in m.signals))
        for m in messages.messages
    ]
    changed = replace(messages, messages=tuple(parts))
    library = MessageLibrary(changed, tmp_path)
    library.library.shim_unit.restype = ctypes.c_char_p
    number = library.numbers["SVC"]
    signal = [s.field for s in messages.by_name["SVC"].signals].index(Field.VALUE)
    assert library.library.shim_unit(number, signal) == unit.encode()


NAMES = ["while", "Int", "src_p", "a b", 'a"b', "a\nb", "1a", "", "é", "a" * 65, "a;b", "a??/", "size"]


@pytest.mark.parametrize("name", NAMES)
def test_names_that_are_no_identifiers_never_become_c(messages: MessageSet, name: str) -> None:
    # A database's grammar lets few of them through; a long name in an attribute, or a set made in Python, any.
    first, *others = messages.messages
    signal = replace(first.signals[0], name=name)
    for changed in (
        replace(messages, name=name),
        replace(messages, messages=(replace(first, name=name), *others)),
        replace(messages, messages=(replace(first, signals=(signal, *first.signals[1:])), *others)),
    ):
        with pytest.raises((GustformError, ErrorList), match="GF8020"):
            c_messages(changed)


def test_long_names_in_attributes_are_checked(tmp_path: Path) -> None:
    attributes = (
        'BA_DEF_ SG_ "SystemSignalLongSymbol" STRING;\nBA_DEF_DEF_ "SystemSignalLongSymbol" "";\n'
        'BA_ "SystemSignalLongSymbol" SG_ 2566869761 Udc "Udc[0]; int evil";\nSIG_VALTYPE_ 2566870017'
    )
    (tmp_path / "maker.dbc").write_text(DBC.replace("SIG_VALTYPE_ 2566870017", attributes))
    (tmp_path / "mapping.yaml").write_text(MAPPING.replace("      Udc:", '      "Udc[0]; int evil":'))
    with pytest.raises(GustformError, match=r"maker.dbc:6:.*GF8020"):
        load_message_set(tmp_path / "maker.dbc", tmp_path / "mapping.yaml")


def test_two_names_that_are_one_in_c(messages: MessageSet) -> None:
    # Message A_B with signal C and message A with signal B_C: both would be set_a_b_c_encode.
    one, two = messages.messages[0], messages.messages[1]
    one = replace(one, name="A_B", signals=(replace(one.signals[0], name="C"),))
    two = replace(two, name="A", signals=(replace(two.signals[0], name="B_C"),))
    with pytest.raises(GustformError, match="GF8021"):
        c_messages(replace(messages, messages=(one, two)))
