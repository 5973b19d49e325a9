"""A file names the modules of parts that are not of the library; they run where the user trusts them."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import shaftwork as sw
from shaftwork.cli import main
from shaftwork.components import REGISTRY

PACKAGE = """
from pathlib import Path

import shaftwork as sw

Path(__file__).with_name("imported").write_text("yes")


@sw.component
class Sledge(sw.Component):
    \"\"\"An inertia of a user's own. Law: tau = J domega/dt.\"\"\"

    J: float = sw.parameter("kg*m^2", "moment of inertia", above=0)
    role = "store"
    ports = (sw.Port("a"),)

    def branches(self, p):
        yield sw.AcrossStore(p.J)
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A user's package with a part, which is forgotten afterwards."""
    folder = tmp_path / "sledges"
    folder.mkdir()
    (folder / "__init__.py").write_text("", encoding="utf-8")
    (folder / "parts.py").write_text(PACKAGE, encoding="utf-8")
    (folder / "broken.py").write_text("raise RuntimeError('no licence')", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield folder
    forget()


def forget() -> None:
    REGISTRY.pop("Sledge", None)
    for name in [name for name in sys.modules if name.partition(".")[0] == "sledges"]:
        del sys.modules[name]


@pytest.fixture
def saved(package: Path, tmp_path: Path) -> Path:
    """The file of a network with such a part, read by someone who does not have it yet."""
    import sledges.parts

    net = sw.Network("own")
    net.add(sw.TorqueSource("motor", tau=2.0), "a")
    net.add(sledges.parts.Sledge("J", J=4.0), "a")
    path = tmp_path / "own.toml"
    net.save(path)
    forget()
    (package / "imported").unlink()
    return path


def test_a_file_names_the_module_and_is_of_the_format_that_can(saved: Path) -> None:
    assert saved.read_text(encoding="utf-8").splitlines()[:3] == [
        "format = 2",
        'name = "own"',
        'modules = ["sledges.parts"]',
    ]


def test_a_trusted_module_is_imported_and_the_network_is_the_same(saved: Path, package: Path) -> None:
    net = sw.Network.load(saved, trust=["sledges"])
    assert (package / "imported").exists()
    assert net.simulate(1.0)["J.omega"][-1] == pytest.approx(0.5, rel=1e-12)
    net.save(saved.with_name("again.toml"))
    assert saved.with_name("again.toml").read_bytes() == saved.read_bytes()
    assert sw.Network.load(saved) == net  # what is imported needs no trust


@pytest.mark.parametrize("trust", [(), ["sledge"], ["sledges.other"], ["sledges.parts.more"]])
def test_a_module_that_is_not_trusted_does_not_run(saved: Path, package: Path, trust: list[str]) -> None:
    with pytest.raises(sw.ModelFileError, match=r"'Sledge' is of the module 'sledges\.parts', .* trust=\['sledges'\]"):
        sw.Network.load(saved, trust=trust)
    assert not (package / "imported").exists()


@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("sledges.broken", r"'sledges\.broken' cannot be imported: no licence"),
        ("sledges.none", r"'sledges\.none' cannot be imported: No module named"),
        ("sledges", r"there is no component 'Sledge'"),
    ],
)
def test_a_module_without_the_part_is_named(saved: Path, module: str, words: str) -> None:
    saved.write_text(saved.read_text(encoding="utf-8").replace("sledges.parts", module), encoding="utf-8")
    with pytest.raises(sw.ModelFileError, match=words):
        sw.Network.load(saved, trust=["sledges"])


def test_modules_of_a_file_whose_parts_are_all_there_are_not_imported(saved: Path, package: Path) -> None:
    text = saved.read_text(encoding="utf-8").replace("Sledge", "Inertia")
    saved.write_text(text, encoding="utf-8")
    sw.Network.load(saved)
    assert not (package / "imported").exists()


@pytest.mark.parametrize("trust", ["sledges", 3, [3], ["a b"], None])
def test_trust_is_a_list_of_packages(saved: Path, trust: object) -> None:
    with pytest.raises(sw.ParameterError, match=r"must be a list of packages whose code may run"):
        sw.Network.load(saved, trust=trust)


def test_the_command_takes_packages_that_are_trusted(saved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(saved)]) != 0
    assert "trust" in "".join(capsys.readouterr())
    assert main(["check", str(saved), "--trust", "sledges"]) == 0


def test_the_circuit_of_such_a_part_names_its_module(package: Path, tmp_path: Path) -> None:
    import sledges.parts

    net = sw.Network("own")
    net.add(sw.TorqueSource("motor", tau=2.0), "a")
    net.add(sledges.parts.Sledge("J", J=4.0), "a")
    net.circuit().save(tmp_path / "circuit.toml")
    forget()
    assert package.is_dir()
    circuit = sw.Network.load(tmp_path / "circuit.toml", trust=["sledges"])
    assert circuit.simulate(1.0).x[-1] == pytest.approx(0.5, rel=1e-12)


def test_a_motion_in_a_file_asks_for_the_same_trust(saved: Path, package: Path) -> None:
    sw.Network.load(saved, trust=["sledges"]).simulate(1.0, t_eval=5, engine="scipy").save(saved.with_name("own.nc"))
    forget()
    (package / "imported").unlink()
    with pytest.raises(sw.ModelFileError, match=r"own\.nc: its network: the part 'Sledge' is of the module"):
        sw.load_solution(saved.with_name("own.nc"))
    assert not (package / "imported").exists()
    again = sw.load_solution(saved.with_name("own.nc"), trust=["sledges"])
    assert again.max("J.omega") == pytest.approx(0.5, rel=1e-8)
