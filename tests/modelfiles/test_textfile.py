"""Model files: an exact round trip, and a named error for everything that is no model file."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftwork.components.tables import Table
from shaftwork.core.errors import ModelFileError
from shaftwork.modelfiles import textfile
from shaftwork.modelfiles.textfile import ModelText, PartText, read, write

HEAD = 'format = 1\nname = "crane"\n'
PART = HEAD + '\n[[part]]\ntype = "Spring"\nname = "shaft"\nnodes = ["rotor", "wheel"]\n'

CRANE = ModelText(
    "crane travel",
    (
        PartText("Inertia", "J1", ("rotor",), {"J": 27.35}, r"J_{1}"),
        PartText("Spring", "shaft", ("rotor", "wheel"), {"c": 24206, "d": 14.0}),
        PartText("TorqueSource", "load", ("wheel",), {"tau": "-22.4*tanh(omega/0.01)"}),
        PartText("TorqueSource", "wind", ("wheel",), {"tau": Table([0, 1], [0, 5])}),
    ),
)
CRANE_TEXT = r"""format = 1
name = "crane travel"

[[part]]
type = "Inertia"
name = "J1"
nodes = ["rotor"]
symbol = "J_{1}"
J = 27.35

[[part]]
type = "Spring"
name = "shaft"
nodes = ["rotor", "wheel"]
c = 24206
d = 14.0

[[part]]
type = "TorqueSource"
name = "load"
nodes = ["wheel"]
tau = "-22.4*tanh(omega/0.01)"

[[part]]
type = "TorqueSource"
name = "wind"
nodes = ["wheel"]
tau = { x = [0.0, 1.0], y = [0.0, 5.0] }
"""

FLOATS = st.floats(allow_nan=False, allow_infinity=False)
NAMES = st.text(min_size=1, max_size=12).filter(lambda text: text.isprintable() and text.strip())
KEYS = st.from_regex(r"[A-Za-z_][A-Za-z0-9_]{0,8}", fullmatch=True).filter(
    lambda key: key not in ("type", "name", "nodes", "symbol")
)
TABLES = st.lists(st.floats(-1e9, 1e9, allow_subnormal=False), min_size=2, max_size=4, unique=True).map(
    lambda x: Table(sorted(x), x)
)
VALUES = st.one_of(FLOATS, st.integers(-(2**63) + 1, 2**63 - 1), st.text(max_size=9).filter(str.isprintable), TABLES)
PARTS = st.builds(
    PartText,
    NAMES,
    NAMES,
    st.lists(NAMES, min_size=1, max_size=3).map(tuple),
    st.dictionaries(KEYS, VALUES, max_size=4),
    st.none() | NAMES,
)
MODELS = st.builds(ModelText, NAMES, st.lists(PARTS, max_size=3).map(tuple))


def test_a_model_is_written_as_the_documented_text() -> None:
    assert write(CRANE) == CRANE_TEXT
    assert read(CRANE_TEXT) == CRANE


@given(MODELS)
def test_every_model_reads_back_as_itself(model: ModelText) -> None:
    again = read(write(model))
    assert again == model
    assert write(again) == write(model)
    # 1 == 1.0 and -0.0 == 0.0: the kinds and the signs must be the same too
    for old, new in zip(model.parts, again.parts, strict=True):
        assert [repr(value) for value in old.parameters.values()] == [repr(v) for v in new.parameters.values()]
        assert list(old.parameters) == list(new.parameters)


@given(MODELS)
def test_the_text_is_toml(model: ModelText) -> None:
    tables = tomllib.loads(write(model))
    assert tables["name"] == model.name
    assert len(tables.get("part", [])) == len(model.parts)


def test_a_file_reads_as_its_text(tmp_path: Path) -> None:
    path = tmp_path / "crane.toml"
    path.write_text(CRANE_TEXT, encoding="utf-8")
    assert read(path) == CRANE
    path.write_bytes(b"\xef\xbb\xbf" + CRANE_TEXT.replace("\n", "\r\n").encode())
    assert read(path) == CRANE


def test_a_hand_written_file_may_have_comments_literal_texts_and_broken_lists() -> None:
    text = PART + "# stiffness\nc = 2.4e4 # of [both]\nsymbol = 'c_{\\theta}'\nd = {x = [\n 0, # s\n 1], y = [2, 3]}\n"
    (part,) = read(text).parts
    assert part.symbol == r"c_{\theta}"
    assert part.parameters == {"c": 2.4e4, "d": Table([0, 1], [2, 3])}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "no line key = value"),
        ("crane.toml", 'give its place as pathlib.Path("crane.toml")'),
        ('name = "a"', "the key format is missing. Start the file with: format = 1"),
        ('format = 3\nname = "a"', "format is 3, and this version reads the formats 1 and 2. Update"),
        ('format = 1\nname = "a"\nmodules = []', "the key modules is unknown here"),
        ('format = 2\nname = "a"\nmodules = "os"', "modules is 'os'. Give names such as"),
        ('format = 2\nname = "a"\nmodules = ["a b"]', "modules is ('a b',)"),
        ('format = 2\nname = "a"\nmodules = [3]', "modules is (3,)"),
        ('format = true\nname = "a"', "format is true"),
        ("format = 1", "name is missing"),
        ("format = 1\nname = 5", "name is 5"),
        (HEAD + "gravity = 9.81", "the key gravity is unknown here"),
        (HEAD + "part = 3", "part is 3"),
        (HEAD + "part = [{}]", "part is [{}]"),
        (HEAD + "[part]", "part is {}"),
        (HEAD + "[[parts]]", "the key parts is unknown here"),
        (PART + "[part.sub]", "line 4, part 'shaft': sub is {}. Write a table as"),
        (PART + "[part.sub.of.it]", "line 8: a key has dots"),
        (PART + "a.b.c = 1", "line 8: a key has dots"),
        (PART + "a.b = 1", "part 'shaft': a is {'b': 1}. Write a table as"),
        (PART + "a = {b.c = 1}", "line 8, part 'shaft': a is"),
        (PART + '"c d" = 1', "part 'shaft': c d is no name of a parameter"),
        (PART + "c = 1\nc = 2\n", "line 9: this is no TOML: Cannot overwrite a value"),
        (PART + "c = 1 d = 2", "line 8: this is no TOML"),
        (PART + "c = ", "this is no TOML"),
        (PART + "c = nan", "line 8, part 'shaft': c is nan. Give a finite number"),
        (PART + "d = 1\nc = -inf", "line 9, part 'shaft': c is -inf"),
        (PART + "c = 1e999", "c is inf"),
        (PART + "c = true", "line 8, part 'shaft': c is true, which is no number"),
        (PART + "c = 9223372036854775808", "line 8, part 'shaft': c is 9223372036854775808"),
        (PART + "c = " + "9" * 5000, "this is no TOML: Exceeds the limit"),
        (PART + "c = 1979-05-27", "line 8, part 'shaft': c is datetime.date"),
        (PART + "c = 07:32:00", "line 8, part 'shaft': c is datetime.time"),
        (PART + "c = [1, 2]", "line 8, part 'shaft': c is [1, 2]"),
        (PART + "c = {x = [0, 1]}", "line 8, part 'shaft': c is {'x': [0, 1]}. Write a table as"),
        (PART + "c = {x = 0, y = 1}", "Write a table as"),
        (PART + "c = {x = [false, 1], y = [0, 1]}", "c has false in its table"),
        (PART + "c = {x = [0, inf], y = [0, 1]}", "c has a wrong table. Table: x[1] = inf"),
        (PART + "c = {x = [1, 0], y = [0, 1]}", "x must increase strictly"),
        (PART + "c = [[[1]]]", "line 8, part 'shaft': c is [[[1]]]. Give a finite number"),
        (PART + 'c = """2*t"""', "line 8: a text stands between"),
        (PART + 'c = "2*t', "line 8: '\"' is not expected here"),
        (PART + 'c = "a\\nb"', "line 8, part 'shaft': c is"),
        (PART + f'c = "{"t" * 200_001}"', "line 8, part 'shaft': c has 200001 characters, more than 200000"),
        (PART + "symbol = 3", "line 8, part 'shaft': symbol is 3"),
        (PART + "k\N{LATIN SMALL LETTER E WITH ACUTE} = 3", "line 8: this is no TOML"),
        (PART + "c = 1\rd = 2", "line 8: this is no TOML"),
        (HEAD + "[[part]]\n", "line 3, part without a name: type is missing"),
        (HEAD + '[[part]]\ntype = "A"\nname = "n"', "line 3, part 'n': nodes is missing"),
        (HEAD + '[[part]]\ntype = "A"\nname = "n"\nnodes = []', "line 6, part 'n': nodes is ()"),
        (HEAD + '[[part]]\ntype = "A"\nname = "n"\nnodes = "a"', "line 6, part 'n': nodes is 'a'"),
        (HEAD + '[[part]]\ntype = "A"\nname = "n"\nnodes = [3]', "line 6, part 'n': nodes is 3"),
        (HEAD + '[[part]]\ntype = "A"\nname = " "\nnodes = ["a"]', "line 5, part ' ': name is ' '"),
        ('format = 1\nname = "a\x00b"', "line 2: this is no TOML"),
        ('format = 1\nname = "a\\u0000b"', "name is 'a\\x00b'"),
        ('format = 1\nname = "a\\u202eb"', "name is 'a\\u202eb'"),
        (f'format = 1\nname = "{"a" * 201}"', "Use 1 to 200 printable characters"),
    ],
)
def test_a_wrong_text_ends_in_an_error_that_names_the_place(text: str, says: str) -> None:
    with pytest.raises(ModelFileError, match=re.escape(says)):
        read(text)


@given(st.lists(st.sampled_from([*"[]{}=\"'#,.\n\r\\ ", "[[part]]", "name", "nodes", "x", "1", "1e9", "\x00", "é"])))
def test_any_text_is_a_model_or_a_named_error(words: list[str]) -> None:
    try:
        read(PART + "".join(words))
    except ModelFileError:
        return
    assert tomllib.loads(PART + "".join(words))["format"] == 1


FULL = textfile.LARGEST_FILE - 200
HOSTILE = {
    "nested lists": "a = " + "[" * FULL,
    "a dotted key": ".".join("a" * (FULL // 2)) + " = 1",
    "a dotted key in a table": PART + "a = {" + " . ".join("a" * (FULL // 4)) + " = 1}",
    "a long list": PART + "a = [" + "1," * (FULL // 2) + "]",
    "many small tables": PART + "a = [" + "{}," * (FULL // 3) + "]",
    "a long number": PART + "a = " + "9" * FULL,
    "escapes": PART + 'a = "' + "\\n" * (FULL // 2) + '"',
    "escaped quotes": PART + 'a = "' + '\\"' * (FULL // 2),
    "backslashes": PART + 'a = "' + "\\" * FULL,
    "quotes": PART + '"' * FULL,
    "empty parts": HEAD + "[[part]]\n" * (FULL // 9),
    "comments": HEAD + "#\n" * (FULL // 2),
    "many keys": PART + "\n".join(f"a{i} = 1" for i in range(FULL // 12)) + "\na0 = 1",
    "too large": "#" * (textfile.LARGEST_FILE + 1),
}


READ_ALL = """
import json, sys
from shaftwork.core.errors import ModelFileError
from shaftwork.modelfiles.textfile import read
for kind, text in json.load(sys.stdin).items():
    try:
        read(text)
    except ModelFileError:
        print(kind)
"""


@pytest.mark.slow
def test_a_hostile_text_ends_in_a_named_error() -> None:
    # a process of its own can be ended; each text takes milliseconds, and those that are not limited take hours
    done = subprocess.run(
        [sys.executable, "-c", READ_ALL],
        input=json.dumps(HOSTILE),
        capture_output=True,
        text=True,
        check=True,
        timeout=300,
    )
    assert done.stdout.splitlines() == [kind for kind in HOSTILE if kind != "comments"]  # which are a short model


@pytest.mark.slow
def test_a_model_of_20000_parts_is_within_the_limits() -> None:
    parts = tuple(
        PartText("Spring", f"shaft{i}", (f"n{i}", f"n{i + 1}"), {"c": 24206.0, "d": 14.0}) for i in range(20000)
    )
    model = ModelText("chain", parts)
    assert read(write(model)) == model


def test_a_place_that_is_no_file_is_named(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path, says in ((tmp_path / "gone.toml", "does not exist"), (tmp_path, "is no file"), (pipe, "is no file")):
        with pytest.raises(ModelFileError, match=says) as caught:
            read(path)
        assert str(path) in str(caught.value)
    with pytest.raises(ModelFileError, match="does not exist"):
        read(Path("a\0b"))


def test_a_file_that_is_too_large_or_no_utf8_is_named(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_bytes(b'format = 1\nname = "\xff"')
    with pytest.raises(ModelFileError, match="line 2: is not UTF-8"):
        read(path)
    path.write_bytes(b"#" * (textfile.LARGEST_FILE + 1))
    with pytest.raises(ModelFileError, match="has more than"):
        read(path)
    path.write_bytes(b"")
    with pytest.raises(ModelFileError, match="no line key = value"):
        read(path)


@pytest.mark.parametrize("value", [float("nan"), True, None, 2**63, "a\nb", [1.0], b"c", {"x": 1}])
def test_a_record_refuses_what_no_file_can_hold(value: object) -> None:
    with pytest.raises(ModelFileError, match=r"^c is "):
        PartText("Spring", "shaft", ("a", "b"), {"c": value})  # type: ignore[dict-item]


@pytest.mark.parametrize("key", ["", "a b", "a.b", "é", "name", "nodes", "a" * 65, "1a"])
def test_a_record_refuses_a_key_that_no_file_can_hold(key: str) -> None:
    with pytest.raises(ModelFileError, match="no name of a parameter"):
        PartText("Spring", "shaft", ("a", "b"), {key: 1.0})


def test_a_law_in_a_file_is_only_a_text() -> None:
    attack = "__import__('os').system('touch owned')"
    (part,) = read(PART + f'tau = "{attack}"').parts
    assert part.parameters == {"tau": attack}


def test_a_text_that_is_too_long_is_told_its_length() -> None:
    with pytest.raises(ModelFileError, match=r"tau has 200001 characters, more than 200000\. Use a Table"):
        PartText("TorqueSource", "T", ("a",), {"tau": "1" * 200_001})


def test_a_place_given_as_a_text_is_told_of_paths() -> None:
    with pytest.raises(ModelFileError, match=r"'crane\.toml' has no line key = value.*pathlib\.Path"):
        read("crane.toml")
