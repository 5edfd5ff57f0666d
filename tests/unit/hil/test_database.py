"""A database and its mapping: what is refused, where, all in one go; and what the fingerprint hangs on."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from gustform.language.errors import ErrorList, GustformError
from gustform_codegen.emit.controller.ranges import INPUT_RANGES, OUTPUT_RANGES
from gustform_hil.database import BUSES, load_message_set, shipped, shipped_files
from gustform_hil.layout import bits, integer_range, real_range
from gustform_hil.message_set import Field, MessageSet, Part

Edit = tuple[str, str]


def load(folder: Path, dbc: list[Edit] = [], mapping: list[Edit] = [], bus: str = "fd") -> MessageSet:  # noqa: B006
    """The shipped set with replacements in its files; each must be there to be replaced."""
    files = []
    for file, edits in zip(shipped_files(bus), (dbc, mapping), strict=True):
        text = file.read_text()
        for old, new in edits:
            assert old in text, old
            text = text.replace(old, new, 1)
        (folder / file.name).write_text(text)
        files.append(folder / file.name)
    return load_message_set(files[0], files[1])


def refusals(act: Callable[[], object]) -> list[GustformError]:
    try:
        act()
    except GustformError as error:
        return [error]
    except ErrorList as several:
        return list(several.errors)
    raise AssertionError("nothing was refused")


def codes(act: Callable[[], object]) -> list[str]:
    return sorted({error.code for error in refusals(act)})


@pytest.mark.parametrize("bus", BUSES)
def test_the_shipped_sets_carry_every_signal_of_every_controller(bus: str) -> None:
    messages = shipped(bus)
    found = {
        (part, s.quantity): (s.low, s.high)
        for part in (Part.MEASUREMENTS, Part.SET_POINTS, Part.REFERENCES)
        for m in messages.pieces(part)
        for s in m.signals
        if s.field == Field.QUANTITY
    }
    inputs = {q: r for (part, q), r in found.items() if part != Part.REFERENCES}
    outputs = {q: r for (part, q), r in found.items() if part == Part.REFERENCES}
    # -0.1 is no float: the next one inside is 6e-9 away, and a code of 16 bits may lie half of 4e-5 away.
    assert {q: inputs[q] for q in INPUT_RANGES} == {q: pytest.approx(r, abs=6e-9) for q, r in INPUT_RANGES.items()}
    assert outputs == {q: pytest.approx(r, abs=1e-12) for q, r in OUTPUT_RANGES.items()}
    assert {m.part for m in messages.messages} == set(Part)
    assert all(m.e2e.profile == (5 if bus == "fd" else 2) for m in messages.messages)
    assert all(s.comment for m in messages.messages for s in m.signals)
    assert all(m.comment for m in messages.messages)
    ids = [(m.id, m.extended) for m in messages.messages]
    assert ids == sorted(ids)


MISTAKES: dict[str, tuple[list[Edit], list[Edit], str, str]] = {
    "message": ([], [("  Sync:", "  Synk:")], "GF8005", "try Sync"),
    "signal": ([], [("      dv_dc: {", "      dvdc: {")], "GF8006", "try dv_dc"),
    "part": ([], [("part: set_points", "part: set_point")], "GF8007", "try set_points"),
    "field": ([], [("Sample: sample", "Sample: sampel")], "GF8007", "try sample"),
    "part twice": ([], [("part: set_points", "part: sync")], "GF8008", "one message"),
    "piece left out": ([], [("part: measurements", "part: measurements\n    piece: 1")], "GF8008", "numbered 0, 1"),
    "part missing": (
        [],
        [(re.search(r"  OperatorCommand:.*?(?=  Param)", shipped_files("fd")[1].read_text(), re.S)[0], "")],  # type: ignore[index]
        "GF8008",
        "operator_command; there is none",
    ),
    "field missing": ([], [("      Enable: enable\n", "")], "GF8009", "enable"),
    "field alien": ([], [("Uptime: uptime", "Uptime: nonce")], "GF8009", "one of e2e_counter"),
    "quantity twice": ([], [("{quantity: dv_dc}", "{quantity: v_dc}")], "GF8009", "the only v_dc"),
    "quantity unknown": ([], [("{quantity: dv_dc}", "{quantity: dvdc}")], "GF8010", "try dv_dc"),
    "range missing": ([("[0|100]", "[0|0]")], [], "GF8011", "range: [low, high]"),
    "range empty": ([("[0|100]", "[100|0]")], [], "GF8011", "from low to high"),
    "range of no code": ([], [("Enable: enable", "Enable: {field: enable, range: [0.2, 0.4]}")], "GF8011", "carry"),
    "state too short": ([("State : 24|8@1+ (1,0) [0|3]", "State : 24|8@1+ (1,0) [0|2]")], [], "GF8011", "up to 3"),
    "unit": ([('[0|2] "pu"', '[0|2] "V"')], [], "GF8012", "base: the value"),
    "unit missing": ([('[-10|90] "deg"', '[-10|90] ""')], [], "GF8012", "deg"),
    "profile": ([('"P01","P02","P05"', '"P01","P02","P07"')], [], "GF8013", "P05"),
    "data id twice": ([('"E2EDataId" BO_ 16 20496', '"E2EDataId" BO_ 16 20608')], [], "GF8013", "of its own"),
    "data ids short": ([], [("part: sync", "part: sync\n    e2e: {profile: 2, data_ids: 0102}")], "GF8013", "16 bytes"),
    "counter moved": ([("Counter : 16|8@1+", "Counter : 17|7@1+")], [], "GF8014", "from bit 16 on"),
    "crc scaled": ([("Crc : 0|16@1+ (1,0)", "Crc : 0|16@1+ (2,0)")], [], "GF8014", "unscaled"),
    "in the header": (
        [("Command : 24|8@1+ (1,0) [0|1]", "Command : 20|8@1+ (1,0) [0|1]")],
        [("      Counter: e2e_counter\n      Command", "      Command")],
        "GF8014",
        "after the E2E header",
    ),
    "identifier twice": ([("BO_ 282 Heart", "BO_ 1794 Heart")], [], "GF8015", "0x702"),
    "multiplexer not mapped": ([], [("      Operation: operation\n", "")], "GF8016", "operation"),
    "multiplexer without values": (
        [
            ('Parameter m0 : 32|16@1+ (1,0) [0|65535] "" CTRL', 'Parameter : 32|16@1+ (1,0) [0|65535] "" CTRL'),
            ("Value m1 :", "Value :"),
            ("SG_MUL_VAL_ 768 Parameter Operation 0-2;\n", ""),
            ("SG_MUL_VAL_ 768 Value Operation 1-1;\n", ""),
        ],
        [],
        "GF8016",
        "0 (read), 1 (write)",
    ),
    "two of three operations": (
        [("SG_MUL_VAL_ 768 Value Operation 1-1", "SG_MUL_VAL_ 768 Value Operation 0-1")],
        [],
        "GF8016",
        "for all of the operations",
    ),
    "33 bits": ([("Sample : 32|32@1+", "Sample : 31|33@1+")], [], "GF8017", "at most 32 bits"),
    "float of 16 bits": ([("wind : 352|32@1-", "wind : 352|16@1-")], [], "GF8017", "IEEE 754"),
    "factor 0": ([("wind : 352|32@1- (1,0)", "wind : 352|32@1- (0,0)")], [], "GF8017", "other than 0"),
    "outside": ([("wind : 352|32@1-", "wind : 360|32@1-")], [], "GF8017", "within the 48 bytes"),
    "overlap": ([("wind : 352|32@1-", "wind : 320|32@1-")], [], "GF8017", "share bits"),
    "signed sample": ([("Sample : 32|32@1+", "Sample : 32|32@1-")], [], "GF8017", "unsigned whole number"),
    "short fingerprint": ([("Fingerprint : 32|32@1+", "Fingerprint : 32|16@1+")], [], "GF8017", "at least 32"),
    "length": ([("Measurements: 48", "Measurements: 47")], [], "GF8019", "47 bytes"),
    "not FD": ([('"VFrameFormat" BO_ 256 14;', '"VFrameFormat" BO_ 256 0;')], [], "GF8019", "StandardCAN_FD"),
    "keyword": ([(" SG_ Uptime :", " SG_ while :")], [("Uptime: uptime", "while: uptime")], "GF8020", "identifier"),
    "name of the set": ([], [("name: gustform_fd", "name: ../gustform")], "GF8020", "identifier"),
    "name of the bridge": ([], [("name: gustform_fd", "name: gust_message")], "GF8020", "identifier"),
    "same in C": (
        [(" SG_ Errors :", " SG_ faults :")],
        [("Errors: errors", "faults: errors")],
        "GF8021",
        "becomes the same",
    ),
    "safe": ([], [("quantity: beta_ref, safe: 90", "quantity: beta_ref, safe: 91")], "GF8022", "[-10, 90]"),
    "key": ([], [("quantity: beta_ref, safe", "quantity: beta_ref, save")], "GF8004", "try safe"),
    "key twice": ([], [("    part: sync", "    part: sync\n    part: sync")], "GF8004", "there once"),
    "no part": ([], [("    part: sync\n", "")], "GF8004", "must have the key part"),
    "number": ([], [("safe: 90", "safe: soon")], "GF8004", "finite number; got 'soon'"),
    "infinite": ([], [("safe: 90", "safe: .inf")], "GF8004", "finite number"),
    "piece": ([], [("part: sync", "part: sync\n    piece: 99")], "GF8004", "0 to 15"),
    "cycle": ([], [("part: sync", "part: sync\n    cycle: -1")], "GF8004", "time in ms"),
    "base 0": ([], [("quantity: dv_dc}", "quantity: dv_dc, base: 0}")], "GF8004", "other than 0"),
    "both": ([], [("{quantity: dv_dc}", "{quantity: dv_dc, field: sample}")], "GF8004", "either field or quantity"),
    "bare quantity": ([], [("{quantity: dv_dc}", "quantity")], "GF8004", "which quantity"),
    "list": ([], [("{quantity: dv_dc}", "[dv_dc]")], "GF8004", "got a list"),
    "e2e": ([], [("part: sync", "part: sync\n    e2e: {profile: 5}")], "GF8004", "data_id"),
}


@pytest.mark.parametrize("what", MISTAKES)
def test_a_mistake_is_refused_with_code_place_and_hint(tmp_path: Path, what: str) -> None:
    dbc, mapping, code, says = MISTAKES[what]
    found = refusals(lambda: load(tmp_path, dbc, mapping))
    matching = [error for error in found if error.code == code]
    assert matching, [str(error) for error in found]
    assert any(says in str(error) for error in matching), [str(error) for error in matching]
    for error in found:
        assert error.place is not None
        assert error.place.file.endswith((".dbc", ".yaml"))
        if what != "part missing":  # what is nowhere has no line
            assert error.place.line > 0
            line = Path(error.place.file).read_text().splitlines()[error.place.line - 1]
            assert error.place.column <= len(line)


def test_all_mistakes_are_told_in_one_go(tmp_path: Path) -> None:
    dbc = [("[0|100]", "[0|0]"), ("Measurements: 48", "Measurements: 49"), ('[0|2] "pu"', '[0|2] "V"')]
    mapping = [("  Sync:", "  Sink:"), ("quantity: dv_dc", "quantity: dvdc"), ("safe: 90", "safe: 99")]
    found = refusals(lambda: load(tmp_path, dbc, mapping))
    assert {"GF8005", "GF8010", "GF8011", "GF8012", "GF8019", "GF8022"} <= {error.code for error in found}
    places = [(error.place.file, error.place.line) for error in found if error.place]
    assert places == sorted(places), "in the order of the files"


def test_more_signals_than_c_has_room_for(tmp_path: Path) -> None:
    # 33 in one message: 31 sample numbers would be refused as doubles, so quantities are taken from a made-up frame.
    signals = "".join(f' SG_ s{k} : {24 + k}|1@1+ (1,0) [0|1] "" CONV\n' for k in range(33))
    dbc = [(' SG_ beta_ref : 288|32@1- (1,0) [-10|90] "deg" CONV,OPER\n', signals.replace("24", "24", 1))]
    rest = "".join(f"      s{k}: enable\n" for k in range(33))
    mapping = [("      beta_ref: {quantity: beta_ref, safe: 90} # blades to feather\n", rest)]
    dbc += [
        ('CM_ SG_ 272 beta_ref "pitch demand";\n', ""),
        ("SIG_VALTYPE_ 272 beta_ref : 1;\n", ""),
    ]
    assert "GF8018" in codes(lambda: load(tmp_path, dbc, mapping))


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    dbc, mapping = shipped_files("fd")
    assert codes(lambda: load_message_set(tmp_path / "none.dbc", mapping)) == ["GF8001"]
    assert codes(lambda: load_message_set(dbc, tmp_path)) == ["GF8001"]
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00name")
    assert codes(lambda: load_message_set(dbc, tmp_path / "binary.yaml")) == ["GF8001"]
    (tmp_path / "large.dbc").write_bytes(b" " * (5 << 20))
    assert codes(lambda: load_message_set(tmp_path / "large.dbc", mapping)) == ["GF8001"]
    assert codes(lambda: shipped("lin")) == ["GF8001"]


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("", "GF8004"),
        ("name", "GF8004"),
        ("- name", "GF8004"),
        ("name: a", "GF8004"),
        ("name: [", "GF8003"),
        ("\tname: a", "GF8003"),
        ("a: !!python/object/apply:os.system ['true']", "GF8004"),
        ("name: a\nmessages: {Sync: 3}", "GF8004"),
        ("name: a\nmessages: {[1]: 3}", "GF8004"),
        ("name: &a [*a]\nmessages: {}", "GF8004"),
        ("name: a\nmessages: &m {Sync: *m}", "GF8004"),
        ("[" * 5_000, "GF8003"),
    ],
)
def test_mappings_that_are_none(tmp_path: Path, text: str, code: str) -> None:
    file = tmp_path / "mapping.yaml"
    file.write_text(text)
    assert code in codes(lambda: load_message_set(shipped_files("fd")[0], file))


def test_the_fingerprint_hangs_on_what_both_sides_must_agree_on(tmp_path: Path) -> None:
    first = shipped("fd").fingerprint
    assert load(tmp_path).fingerprint == first
    unimportant: list[tuple[list[Edit], list[Edit]]] = [
        ([('CM_ SG_ 272 beta_ref "pitch demand"', 'CM_ SG_ 272 beta_ref "pitch"')], []),
        ([('"GenMsgCycleTime" BO_ 280 10', '"GenMsgCycleTime" BO_ 280 20')], []),
        ([], [("name: gustform_fd", "name: other")]),
        ([("wind : 352", "gust : 352"), ("256 wind : 1", "256 gust : 1")], [("      wind: {", "      gust: {")]),
        ([], [("safe: 90", "safe: 80")]),
    ]  # fmt: skip
    for dbc, mapping in unimportant:
        assert load(tmp_path, dbc, mapping).fingerprint == first
    keys = ("E2EProfile", "E2EDataId", "VFrameFormat")
    swapped = [
        ("v_d: {quantity: v_d, safe: 1}", "v_d: {quantity: v_q}"),
        ("v_q: {quantity: v_q}", "v_q: {quantity: v_d}"),
    ]
    important: list[tuple[list[Edit], list[Edit]]] = [
        ([("BO_ 282 Heart", "BO_ 1795 Heart"), *((f'"{key}" BO_ 282', f'"{key}" BO_ 1795') for key in keys)], []),
        ([("[0|100]", "[0|101]")], []),
        ([("(1,0) [0|100]", "(2,0) [0|100]")], []),
        ([("(1,0) [0|100]", "(1,1) [1|100]")], []),
        ([('"E2EDataId" BO_ 16 20496', '"E2EDataId" BO_ 16 20497')], []),
        ([("P_gsc : 192", "P_gsc : 224"), ("Q_gsc : 224", "Q_gsc : 192")], []),
        ([], swapped),
        ([], [("      Errors: errors\n", "")]),
        ([], [("part: sync", "part: sync\n    e2e: {profile: 5, data_id: 0x77}")]),
    ]  # fmt: skip
    seen = {first}
    for dbc, mapping in important:
        seen.add(load(tmp_path, dbc, mapping).fingerprint)
    assert len(seen) == 1 + len(important)


def test_the_fingerprint_is_stable_between_releases() -> None:
    # A change here needs both sides of a bench to be built anew: it is meant, or it is a mistake.
    assert shipped("fd").fingerprint == FINGERPRINTS["fd"]
    assert shipped("classic").fingerprint == FINGERPRINTS["classic"]


FINGERPRINTS = {"fd": 0xE467421C, "classic": 0x15181C66}


def test_ends_of_ranges_are_what_the_bits_carry() -> None:
    # 100.3 at a factor of 0.5 is code 200.6: 201 would come back as 100.5, out of range for whoever decodes it.
    assert integer_range(0.0, 100.3, 0.5, 0.0, 0, 65535) == (0.0, 100.0)
    assert integer_range(0.0, 100.0, 0.5, 0.0, 0, 100) == (0.0, 50.0)  # 7 bits' worth
    assert integer_range(-1.0, 1.0, -0.125, 0.0, -128, 127) == (-1.0, 1.0)
    assert integer_range(0.2, 0.4, 1.0, 0.0, 0, 255) is None
    # 0.1 as a float lies above 0.1, -0.1 below: the neighbour inside is taken.
    low, high = real_range(-0.1, 0.1, 1.0, 0.0, 32) or (0.0, 0.0)
    assert -0.1 < low < -0.0999999
    assert 0.0999999 < high < 0.1
    assert real_range(0.0, 1e40, 1.0, 0.0, 32) == (0.0, 3.4028234663852886e38)
    assert real_range(-0.1, 0.1, 1.0, 0.0, 64) == (-0.1, 0.1)
    assert real_range(1e-46, 1e-45, 1.0, 0.0, 32) is None


def test_bits_of_both_byte_orders() -> None:
    assert bits(4, 8, False) == [4, 5, 6, 7, 8, 9, 10, 11]
    # Motorola: the start is the most significant bit, and the next byte begins at its bit 7.
    assert bits(3, 8, True) == [12, 13, 14, 15, 0, 1, 2, 3]
    assert bits(7, 8, True) == [0, 1, 2, 3, 4, 5, 6, 7]


def test_messages_and_signals_are_found() -> None:
    messages = shipped("classic")
    assert [m.piece for m in messages.pieces(Part.REFERENCES)] == [0, 1, 2]
    piece = messages.find(Part.REFERENCES, 2)
    assert piece is not None
    assert piece.signal(Field.QUANTITY, "beta_ref") is not None
    assert piece.signal(Field.QUANTITY, "v_dc") is None
    assert messages.find(Part.SYNC, 1) is None
    assert replace(piece, piece=3) != piece
