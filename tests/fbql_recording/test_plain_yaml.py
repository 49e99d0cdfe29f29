"""YAML from outside is plain data, or one line that says why not, whatever it holds."""

from __future__ import annotations

import math
from pathlib import Path
from time import process_time

import pytest
import yaml
from fbql_common.core.errors import BadInput
from fbql_recording.bag_metadata import to_yaml
from fbql_recording.plain_yaml import MAX_DEPTH, MAX_VALUES, from_yaml, mapping_from_yaml
from places import ROOT

RECORDED = ROOT / "tests" / "data" / "recorded_match"
BOMB = "a0: &a0 {k: v}\n" + "\n".join(f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 10)}]}}" for n in range(1, 12))
LAUGHS = "a0: &a0 [x]\n" + "\n".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 10))

TOWER = "a0: &a0 [x]\n" + "\n".join(f"a{n}: &a{n} [[*a{n - 1}]]" for n in range(1, 20))


@pytest.mark.parametrize("path", [RECORDED / "metadata.yaml", RECORDED / "config.yaml"], ids=lambda path: path.name)
def test_our_own_files_read_as_any_yaml_reader_reads_them(path: Path):
    assert from_yaml(path.read_bytes(), "x") == yaml.safe_load(path.read_bytes())


VALUES = [
    *(
        "",
        "text",
        "1e5",
        "1.e+3",
        "1.5",
        "0x1F",
        "010",
        "1:30",
        "2024-01-01",
        "=",
        "<<",
        "~",
        "null",
        "yes",
        "off",
        "- x",
    ),
    *(
        "a: b",
        "#",
        "!!bool x",
        "&a",
        "*a",
        ".inf",
        "-.inf",
        ".nan",
        "0",
        "-0",
        "+1",
        "1_000",
        "0b1",
        "08",
        "-",
        "ü\u2028\n",
    ),
    *(0, -1, 2**63 - 1, 2**64 - 1, -(2**63), 0.0, -0.0, 1e-300, 1e300, 1.5, math.inf, -math.inf, True, False, None),
    *([], {}, [[]], {"1": {"~": [None]}}),
]


@pytest.mark.parametrize("value", VALUES, ids=repr)
def test_what_our_writer_writes_reads_back_as_it_was(value):
    there = from_yaml(to_yaml({"x": value, "y": [value]}), "x")
    assert there == {"x": value, "y": [value]}
    assert [type(each) for each in there["y"]] == [type(value)]


def test_not_a_number_reads_back_as_it_was():
    assert math.isnan(from_yaml(to_yaml({"x": math.nan}), "x")["x"])


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a: !!bool foo", "line 1: tags are not read"),
        ("a: 1\nb: !!timestamp x", "line 2: tags are not read"),
        ('a: !!int ""', "tags"),
        ("a: !!float x", "tags"),
        ("a: !!binary x", "tags"),
        ("a: !!set {x}", "tags"),
        ("!!python/object/apply:os.system [x]", "tags"),
        ("a: !own x", "tags"),
        ("? !!str a\n: b", "tags"),
        ("a: &x [*x]", "line 1: an alias of nothing, or of itself"),
        ("a: *x", "an alias of nothing"),
        ("? &x a\n: &y b\n*x : c", "a name that is not a text"),
        ("<<: {a: 1}", "a name that is not a text"),
        ("? [a]\n: b", "a name that is not a text"),
        ("? {a: 1}\n: b", "a name that is not a text"),
        ("a: 1\na: 2", "line 2: 'a' is there twice"),
        (BOMB, "a name that is not a text"),
        (LAUGHS, "more than 500000 values"),
        (TOWER, f"nested more than {MAX_DEPTH} deep"),
        ("[" * 100_000, f"nested more than {MAX_DEPTH} deep"),
        ("a: " + "[" * 100_000 + "]" * 100_000, f"nested more than {MAX_DEPTH} deep"),
        ("{a: " * 100_000, f"nested more than {MAX_DEPTH} deep"),
        ("- " * 100_000, f"nested more than {MAX_DEPTH} deep"),
        ("? " * 100_000, "nested|not a text"),
        ("a: " + "9" * 100_000, "more than 64 bits"),
        ("a: 18446744073709551616", "more than 64 bits"),
        ("a: 0x_", "more than 64 bits, or not a number"),
        ("a: 1\n---\nb: 2", "more than one YAML document"),
        ("a: '\0'", "not YAML"),
        (b"a: \xff", "not UTF-8"),
        ("a: 1".encode("utf-16"), "not UTF-8"),
        ("a: \ud800", "not YAML"),
        ("a: %", "not YAML"),
        ("a: [", "not YAML"),
        ("a: @", "not YAML"),
        ("%YAML 9.9\n--- a", "not YAML"),
        ("[" + "a," * (MAX_VALUES + 1) + "]", f"more than {MAX_VALUES} values"),
    ],
    ids=lambda value: repr(value)[:30],
)
def test_what_is_not_plain_data_is_one_line_soon(text, says):
    begun_s = process_time()
    with pytest.raises(BadInput, match=f"^x: .*({says})") as caught:
        from_yaml(text, "x")
    assert "\n" not in str(caught.value)
    assert process_time() - begun_s < 10.0


def test_an_alias_is_what_it_stands_for():
    """rosbag2 wrote the quality of service so before Jazzy."""
    assert from_yaml("a: &x {sec: 1}\nb: *x\nc: [*x, &y 2, *y]", "x") == {
        "a": {"sec": 1},
        "b": {"sec": 1},
        "c": [{"sec": 1}, 2, 2],
    }


def test_names_are_texts_whatever_they_look_like():
    assert from_yaml("1: a\ntrue: b\n~: c\n1.5: d\n2024-01-01: e", "x") == dict(
        zip(("1", "true", "~", "1.5", "2024-01-01"), "abcde", strict=True)
    )


@pytest.mark.parametrize("text", ["", "- a", "text", "1", "~"])
def test_a_mapping_is_asked_for(text):
    with pytest.raises(BadInput, match=r"^x: not a mapping"):
        mapping_from_yaml(text, "x")
