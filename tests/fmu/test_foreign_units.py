"""An FMU of another tool as a part of a network does what the same parts of Shaftwork do."""

from __future__ import annotations

import contextlib
import copy
import pickle
import re
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.components.external import evaluated
from shaftwork.fmu.foreign_unit import FMU, ForeignUnit
from tests.fmu.foreign_units import INERTIA, SPEED, SPRING, TORQUE, built, zipped

pytest.importorskip("fmpy")
pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="FMUs are compiled by gcc")

START = {"J": 3.0}


@pytest.fixture(scope="module")
def spring(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(tmp_path_factory.mktemp("spring") / "spring.fmu", SPRING, **TORQUE)


@pytest.fixture(scope="module")
def inertia(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(tmp_path_factory.mktemp("inertia") / "inertia.fmu", INERTIA, **SPEED)


def in_units(path: Path, folder: Path, speed: str, torque: str) -> Path:
    """The unit again, whose description tells units of its input and its output."""
    bases = {
        "rev/min": f's="-1" rad="1" factor="{np.pi / 30.0!r}"',
        "deg/s": f's="-1" rad="1" factor="{np.pi / 180.0!r}"',
        "°/min": f's="-1" rad="1" factor="{np.pi / 10_800.0!r}"',
        "kN.m": 'kg="1" m="2" s="-2" factor="1000"',
        "N.mm": 'kg="1" m="2" s="-2" factor="0.001"',
        "°C": 'K="1" offset="273.15"',
    }
    bases = {unit: f"<BaseUnit {base}/>" for unit, base in bases.items()}
    units = (f'<Unit name="{unit}">{bases.get(unit, "")}</Unit>' for unit in (speed, torque))
    changed = folder / "units.fmu"
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(changed, "w") as target:
        for name in source.namelist():
            text = source.read(name)
            if name == "modelDescription.xml":
                words = text.decode().replace('causality="input"><Real', f'causality="input"><Real unit="{speed}"')
                words = words.replace('causality="output"><Real', f'causality="output"><Real unit="{torque}"')
                definitions = f"<UnitDefinitions>{''.join(units)}</UnitDefinitions>"
                text = words.replace("<ModelVariables>", f"{definitions}<ModelVariables>").encode()
            target.writestr(name, text)
    return changed


def driven(name: str = "two masses") -> sw.Network:
    net = sw.Network(name)
    net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    net.add(sw.Inertia("J1", J=1.5), "rotor")
    return net


def with_spring(path: Path) -> sw.Network:
    net = driven()
    net.add(sw.FMUTorque("rest", fmu=sw.FMU(path, speed="u", torque="tau", start=START)), "rotor")
    return net


def two_masses(d: float = 0.5) -> sw.Network:
    net = driven()
    net.add(sw.Spring("shaft", c=50.0, d=d), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    return net


@pytest.mark.parametrize(("engine", "tolerated"), [("scipy", 1e-8), ("auto", 1e-8), ("sundials", 1e-6)])
def test_a_unit_that_gives_torque_moves_as_the_parts_that_it_stands_for(
    spring: Path, engine: str, tolerated: float
) -> None:
    """The unit starts with a speed of its mass of 1 rad/s; tolerated is a hundred times the error of the engines."""
    with_unit = with_spring(spring).simulate(2.0, rtol=1e-10, engine=engine)
    plain = two_masses().simulate(2.0, rtol=1e-10, initial={"J2.omega": 1.0})
    assert np.abs(with_unit["J1.omega"] - plain["J1.omega"]).max() < tolerated
    assert np.abs(with_unit["rest.tau"] + plain["shaft.tau"]).max() < 20 * tolerated
    assert with_unit.energy_residual < 1e-8


def test_a_unit_that_gives_speed_moves_as_the_inertia_that_it_stands_for(inertia: Path) -> None:
    net = sw.Network("driven by a unit")
    net.add(sw.FMUSpeed("J1", fmu=sw.FMU(inertia, speed="w1", torque="u", start=START)), "rotor")
    net.add(sw.Spring("shaft", c=50.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=1.5), "wheel")
    net.add(sw.TorqueSource("motor", tau=10.0), "wheel")
    with_unit = net.simulate(2.0, rtol=1e-10)
    plain = two_masses(d=0.0).simulate(2.0, rtol=1e-10, initial={"J2.omega": 1.0})  # the other way round
    assert np.abs(with_unit["J2.omega"] - plain["J1.omega"]).max() < 1e-8
    assert np.abs(with_unit["shaft.tau"] + plain["shaft.tau"]).max() < 2e-7


def test_small_motions_read_the_slopes_of_a_unit(spring: Path) -> None:
    """Slopes are differences, good to ten digits."""
    np.testing.assert_allclose(with_spring(spring).modes().frequencies, two_masses().modes().frequencies, atol=1e-8)


def test_the_gain_multiplies_the_torque(spring: Path) -> None:
    net = driven()
    net.add(sw.FMUTorque("rest", fmu=sw.FMU(spring, speed="u", torque="tau"), gain=-2.0), "rotor")
    motion, model = net.simulate(0.1), net.compile()
    unit = ForeignUnit(FMU(spring, "u", "tau"), "speed", "torque")
    state = tuple(motion[name][-1] for name in model.states)
    assert motion["rest.tau"][-1] == pytest.approx(-2.0 * unit.value(2, (0.1, *state[1:], state[0])), rel=1e-12)


@pytest.mark.parametrize(
    ("speed", "torque", "speeds", "torques"),
    [
        ("rad/s", "N.m", 1.0, 1.0),
        ("rev/min", "kN.m", np.pi / 30.0, 1e3),
        ("deg/s", "N.mm", np.pi / 180.0, 1e-3),
        ("°/min", "J", np.pi / 10_800.0, 1.0),
    ],
)
def test_units_of_the_variables_are_converted(
    spring: Path, tmp_path: Path, speed: str, torque: str, speeds: float, torques: float
) -> None:
    """The same binary, told to speak other units, takes smaller numbers and gives larger ones."""
    path = in_units(spring, tmp_path, speed, torque)
    converted = ForeignUnit(FMU(path, "u", "tau"), "speed", "torque").value(2, (0.0, 0.01, 0.2, 0.7))
    plain = ForeignUnit(FMU(spring, "u", "tau"), "speed", "torque").value(2, (0.0, 0.01, 0.2, 0.7 / speeds))
    assert converted == pytest.approx(torques * plain, rel=1e-14)


@pytest.mark.parametrize(
    ("speed", "torque", "message"),
    [
        ("m/s", "N.m", r"speed names 'u', whose unit 'm/s' does not agree with 'rad/s'"),
        ("rad/s", "N", r"torque names 'tau', whose unit 'N' does not agree with 'N\*m'"),
        ("rad", "N.m", "unit 'rad' does not agree"),
        ("Hz", "N.m", "unit 'Hz' does not agree"),
        ("rpm", "N.m", "unit 'rpm' does not agree.*BaseUnit"),
        ("°C", "N.m", "unit '°C' does not agree"),
    ],
)
def test_a_variable_of_another_quantity_is_refused(
    spring: Path, tmp_path: Path, speed: str, torque: str, message: str
) -> None:
    path = in_units(spring, tmp_path, speed, torque)
    with pytest.raises(sw.ParameterError, match=message):
        sw.FMU(path, speed="u", torque="tau")


def test_networks_with_units_travel(spring: Path) -> None:
    net = with_spring(spring)
    again = pickle.loads(pickle.dumps(net))  # noqa: S301 (of our own making)
    assert (again.simulate(0.2)["J1.omega"] == net.simulate(0.2)["J1.omega"]).all()


def test_a_motion_with_a_unit_is_stored_without_a_file_that_names_it(spring: Path, tmp_path: Path) -> None:
    motion = with_spring(spring).simulate(0.2)
    for again in (pickle.loads(pickle.dumps(motion)), copy.deepcopy(motion)):  # noqa: S301 (of our own making)
        assert again["rest.tau"][-1] == motion["rest.tau"][-1]
    for name in ("motion.nc", "motion.parquet"):
        with pytest.raises(
            sw.ModelFileError, match=r"FMUTorque 'rest' cannot be saved: fmu .*pickle it, or.*to_pandas"
        ):
            motion.save(tmp_path / name)
    assert list(motion.to_pandas("rest.tau").columns) == ["rest.tau"]


def test_a_law_outside_is_evaluated_for_arrays_as_for_numbers(spring: Path) -> None:
    unit = with_spring(spring).compile()
    x = np.random.default_rng(1).uniform(-1.0, 1.0, (3, 4))
    columns = [unit.rhs(0.0, column) for column in x.T]
    np.testing.assert_allclose(unit.rhs(0.0, x), np.transpose(columns), rtol=1e-12)
    with pytest.raises(KeyError):
        evaluated("no such program", 0, -1, 1.0)


def test_a_unit_is_printed_as_a_function_and_has_no_c_code(spring: Path, tmp_path: Path) -> None:
    net = with_spring(spring)
    assert r"f_{2}\left(t" in net.equations().latex()
    assert r"f_{2}\left(t" in net.equations().latex(values=True)
    for refused in (net.compile().to_c, lambda folder: net.compile().to_fmu(folder / "unit.fmu")):
        with pytest.raises(sw.CompileError, match="is an FMU, of which there is no C code"):
            refused(tmp_path)


@pytest.mark.parametrize(
    ("engine", "error", "said"),
    [("heyoka", sw.SimulationError, "has another law"), ("numba", sw.ParameterError, "functions of your own")],
)
def test_no_engine_in_machine_code_takes_a_unit(spring: Path, engine: str, error: type[Exception], said: str) -> None:
    with pytest.raises(error, match=said):
        with_spring(spring).simulate(0.1, engine=engine)


def test_no_model_file_holds_a_unit(spring: Path, tmp_path: Path) -> None:
    with pytest.raises(sw.ModelFileError, match="program that would run"):
        with_spring(spring).save(tmp_path / "net.toml")
    (tmp_path / "net.toml").write_text(
        'format = 1\nname = "n"\n\n[[part]]\ntype = "FMUTorque"\nname = "u"\nnodes = ["r"]\nfmu = "FMU(1)"\n'
    )
    with pytest.raises(sw.ModelFileError, match="line 8"):
        sw.Network.load(tmp_path / "net.toml")


def test_a_unit_that_fails_ends_the_run_with_its_time(tmp_path: Path) -> None:
    path = built(tmp_path / "fails.fmu", SPRING, fails="t > 0.5 ? 3 : 0", **TORQUE)
    with pytest.raises(sw.SimulationError, match=r"'fails.fmu' failed at t = 0\.5"):
        with_spring(path).simulate(1.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"speed": "v", "torque": "tau"}, "speed names 'v'.*It has: u, tau"),
        ({"speed": "u", "torque": "J"}, "torque names 'J'"),
        ({"speed": "u", "torque": "tau", "start": {"q": 1.0}}, "start names 'q'.*u, J, c, d"),
        ({"speed": "u", "torque": "tau", "start": {"J": float("nan")}}, "finite number"),
        ({"speed": "u", "torque": "tau", "start": {"J": True}}, "finite number"),
    ],
)
def test_a_wrong_name_is_answered_with_those_that_exist(spring: Path, options: dict[str, object], message: str) -> None:
    with pytest.raises(sw.ParameterError, match=message):
        sw.FMU(spring, **options)


@pytest.mark.parametrize(
    ("says", "message"),
    [
        ({**TORQUE, "kind": "CoSimulation"}, "co-simulation alone.*model.start"),
        ({**TORQUE, "indicators": "2"}, "2 event indicators"),
        ({**TORQUE, "torque": 'output" variability="discrete'}, "torque names 'tau', which changes at events alone"),
    ],
)
def test_what_a_right_hand_side_cannot_evaluate_is_refused(tmp_path: Path, says: dict[str, str], message: str) -> None:
    with pytest.raises(sw.ParameterError, match=message):
        sw.FMU(zipped(tmp_path / "unit.fmu", **says), speed="u", torque="tau")


def test_a_unit_in_the_wrong_role_is_refused(spring: Path, tmp_path: Path) -> None:
    with pytest.raises(sw.ParameterError, match="speed = 'tau' must be an input and torque = 'u' an output"):
        sw.FMUTorque("rest", fmu=sw.FMU(spring, speed="tau", torque="u"))
    with pytest.raises(sw.ParameterError, match="algebraic loop"):
        sw.FMUSpeed("rest", fmu=sw.FMU(spring, speed="tau", torque="u"))
    with pytest.raises(sw.ParameterError, match=r"fmu=sw\.FMU"):
        sw.FMUTorque("rest", fmu=str(spring))
    with pytest.raises(sw.ParameterError, match="No such file"):
        sw.FMU(tmp_path / "none.fmu", speed="u", torque="tau")
    (tmp_path / "text.fmu").write_text("no archive")
    with pytest.raises(sw.ParameterError, match="no FMU that can be read"):
        sw.FMU(tmp_path / "text.fmu", speed="u", torque="tau")


@settings(max_examples=300)
@given(place=st.integers(0, 2400), length=st.integers(0, 40), text=st.text(alphabet='<>"/=&; \t0129azé-.', max_size=12))
def test_a_mutated_description_is_read_or_refused_by_name(
    tmp_path_factory: pytest.TempPathFactory, place: int, length: int, text: str
) -> None:
    path = zipped(tmp_path_factory.mktemp("mutated") / "unit.fmu", **TORQUE)
    with zipfile.ZipFile(path) as archive:
        original = archive.read("modelDescription.xml").decode()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", original[:place] + text + original[place + length :])
    with contextlib.suppress(sw.ParameterError):
        assert len(sw.FMU(path, speed="u", torque="tau").states) <= 2


def test_a_binary_that_cannot_be_loaded_leaves_the_working_directory(
    spring: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = tmp_path / "broken.fmu"
    with zipfile.ZipFile(spring) as source, zipfile.ZipFile(broken, "w") as target:
        for name in source.namelist():
            target.writestr(name, b"x" if name.startswith("binaries/") else source.read(name))
    monkeypatch.chdir(tmp_path)
    net = with_spring(broken)
    with pytest.raises(sw.SimulationError, match="Failed to load"):
        net.simulate(0.1)
    assert Path.cwd() == tmp_path


def test_a_binary_of_another_export_is_told_by_the_number_of_its_states(tmp_path: Path) -> None:
    """A rate is left out of the ModelStructure, as if the description were that of an older network."""
    path, other = tmp_path / "unit.fmu", tmp_path / "other.fmu"
    two_masses().compile().to_fmu(path, inputs=["motor.tau"], outputs=["J1.omega"])
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(other, "w") as target:
        for name in source.namelist():
            text = source.read(name)
            if name == "modelDescription.xml":
                text = re.sub(r"<ContinuousStateDerivative .*?/>", "", text.decode(), count=1).encode()
            target.writestr(name, text)
    net = driven()
    net.add(sw.Spring("shaft", c=50.0), "rotor", "flange")
    net.add(sw.FMUSpeed("rest", fmu=sw.FMU(other, speed="J1.omega", torque="motor.tau")), "flange")
    with pytest.raises(sw.SimulationError, match=r"other.fmu' has 3 continuous states, but .* tells 2"):
        net.simulate(0.1)


@pytest.mark.parametrize(("path", "start"), [(3, {}), (None, {}), ("spring.fmu", 3)])
def test_arguments_of_other_types_are_refused_by_name(path: object, start: object) -> None:
    with pytest.raises(sw.ParameterError, match=r"must be the name of a file|must map names to values"):
        sw.FMU(path, "u", "tau", start)  # type: ignore[arg-type]
