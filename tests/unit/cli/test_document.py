"""YAML with places, overrides, and texts that are no scenario."""

from __future__ import annotations

from pathlib import Path

import hypothesis
import pytest

from gustform.language.errors import GustformError
from gustform_cli import document

TEXT = """\
# a comment
name: case
components:
  load: {P: 100 MW, Q: 5 Mvar}   # beside it
  wt:
    type: T
    rates: [1, 2]
events:
  - at: 30 s
"""


def test_places_count_from_one() -> None:
    read = document.parse(TEXT, "s.yaml")
    assert str(read.place(("components", "load", "P"))) == "s.yaml:4:13"
    assert str(read.place(("components", "load", "P"), key=True)) == "s.yaml:4:10"
    assert str(read.place(("components", "wt", "rates", 1))) == "s.yaml:7:16"
    assert str(read.place(("events", 0, "at"))) == "s.yaml:9:9"
    # What is not there is placed at what should hold it.
    assert str(read.place(("components", "wt", "missing"))) == "s.yaml:6:5"


def test_yaml_12_scalars() -> None:
    read = document.parse("a: 1e-6\nb: on\nc: no\nd: 010\ne: true\nf: 2020-01-01\n", "s.yaml").plain()
    assert read == {"a": 1e-6, "b": "on", "c": "no", "d": 10, "e": True, "f": "2020-01-01"}


def test_overrides_keep_comments_and_know_their_place() -> None:
    read = document.parse(TEXT, "s.yaml", ["load.P=120 MW", "components.wt.rates[1]=7", "run.until=3 s", "name=other"])
    plain = read.plain()
    assert plain["components"]["load"]["P"] == "120 MW"
    assert plain["components"]["wt"]["rates"] == [1, 7]
    assert plain["run"] == {"until": "3 s"}
    assert plain["name"] == "other"
    assert str(read.place(("components", "load", "P"))) == "--set load.P=120 MW"
    assert "# beside it" in read.text()
    assert document.parse(read.text(), "again.yaml").plain() == plain


@pytest.mark.parametrize(
    ("override", "part"),
    [
        ("nonsense", "path=value"),
        ("=3", "path=value"),
        ("components.lod.P=3", "no 'lod'"),
        ("load.P.deep=3", "single value"),
        ("components.wt.rates.9=3", "2 items"),
        ("lode.x.P=1", "no 'lode'"),
    ],
)
def test_overrides_that_lead_nowhere(override: str, part: str) -> None:
    with pytest.raises(GustformError) as caught:
        document.parse(TEXT, "s.yaml", [override])
    assert caught.value.code == "GF2105"
    assert part in caught.value.message
    assert str(caught.value.place) == f"--set {override}"


@pytest.mark.parametrize(
    ("text", "code", "place"),
    [
        ("a: 1\nb: 2\na: 3\n", "GF2103", "s.yaml:3:1"),
        ("a:\n  wt: {x: 1}\n  wt: {x: 2}\n", "GF2103", "s.yaml:3:3"),
        ("a: [1\nb: 2", "GF2102", "s.yaml:2:2"),
        ("\tname: a", "GF2102", "s.yaml:1:1"),
        ("a: *nothing", "GF2102", "s.yaml:1:4"),
        ("a: 1\n---\nb: 2\n", "GF2102", "s.yaml:2:1"),
        ("", "GF2104", "s.yaml:1:1"),
        ("- a\n- b\n", "GF2104", "s.yaml:1:1"),
        ("a: !!python/object/apply:os.system [ls]\n", "GF2104", "s.yaml:1:4"),
        ("a: {1: 2}\n", "GF2104", "s.yaml:1:5"),
        ("a: !custom {b: 1}\n", "GF2104", "s.yaml:1:4"),
        ("a: !!binary aGVq\n", "GF2104", "s.yaml:1:4"),
    ],
)
def test_texts_that_are_no_scenario(text: str, code: str, place: str) -> None:
    with pytest.raises(GustformError) as caught:
        document.parse(text, "s.yaml").plain()
    assert caught.value.code == code
    assert str(caught.value.place) == place


def test_a_bomb_of_aliases_is_refused() -> None:
    text = "a0: &a0 [x, x, x, x, x, x, x, x]\n" + "".join(
        f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 8)}]\n" for k in range(1, 9)
    )
    with pytest.raises(GustformError, match="GF2104"):
        document.parse(text, "s.yaml").plain()


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    for file in (tmp_path / "missing.yaml", tmp_path):
        with pytest.raises(GustformError) as caught:
            document.read(file)
        assert caught.value.code == "GF2101"
    latin = tmp_path / "latin.yaml"
    latin.write_bytes(b"name: caf\xe9\n")
    with pytest.raises(GustformError, match="UTF-8"):
        document.read(latin)


@hypothesis.given(text=hypothesis.strategies.text(alphabet="ab:-[]{}&*!#|>'\"%@,? \n\t1.", max_size=40))
def test_no_text_does_harm(text: str) -> None:
    caught: GustformError | None = None
    try:
        assert isinstance(document.parse(text, "s.yaml", [text] if "=" in text else []).plain(), dict)
    except GustformError as error:
        caught = error
    assert caught is None or (caught.code in {"GF2102", "GF2103", "GF2104", "GF2105"} and caught.place is not None)
