"""An exported FMU is valid, moves as the network does, and keeps its instances apart."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path
from random import Random
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import shaftwork as sw

fmpy = pytest.importorskip("fmpy")

from fmpy.validation import validate_fmu  # noqa: E402 (only where FMPy is installed)

from tests.fmu.units import KINDS, VERSIONS, instances, two_masses  # noqa: E402

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="FMUs are compiled by gcc")

Units = Callable[[str], Path]
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror"]
MAIN = """
#include <stddef.h>
void *fmi2Instantiate(const char *, int, const char *, const char *, const void *, int, int);
int fmi2SetupExperiment(void *, int, double, double, int, double);
int fmi2EnterInitializationMode(void *);
int fmi2ExitInitializationMode(void *);
int fmi2DoStep(void *, double, double, int);
int fmi2GetFMUstate(void *, void **);
int fmi2SetFMUstate(void *, void *);
int fmi2FreeFMUstate(void *, void **);
int fmi2Reset(void *);
void fmi2FreeInstance(void *);
int main(void)
{
    for (int n = 0; n < 1000; n++) {
        void *state = NULL, *unit = fmi2Instantiate("unit", 1, TOKEN, "", NULL, 0, 0);
        if (unit == NULL) return 1;
        if (fmi2SetupExperiment(unit, 1, 1e-6, 0.0, 0, 0.0) || fmi2EnterInitializationMode(unit)
            || fmi2ExitInitializationMode(unit) || fmi2DoStep(unit, 0.0, 1e-3, 1) || fmi2GetFMUstate(unit, &state)
            || fmi2DoStep(unit, 1e-3, 1e-3, 1) || fmi2SetFMUstate(unit, state) || fmi2GetFMUstate(unit, &state)
            || fmi2FreeFMUstate(unit, &state) || fmi2Reset(unit)) return 2;
        fmi2FreeInstance(unit);
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def unit(tmp_path_factory: pytest.TempPathFactory) -> Units:
    """The unit of two masses by its version; the motor's torque is an input."""
    folder, model = tmp_path_factory.mktemp("units"), two_masses().compile()
    paths = {version: folder / f"unit {version}.fmu" for version in VERSIONS}
    for version, path in paths.items():
        model.to_fmu(path, version=version, inputs=["motor.tau"], t_end=2.0)
    return lambda version: paths[version]


@pytest.mark.parametrize("version", VERSIONS)
def test_the_validator_finds_nothing(unit: Units, version: str) -> None:
    assert validate_fmu(str(unit(version))) == []
    description = fmpy.read_model_description(str(unit(version)))
    variables = {variable.name: variable for variable in description.modelVariables}
    assert description.variableNamingConvention == "structured"
    assert (variables["shaft.c"].unit, float(variables["shaft.c"].start)) == ("N*m/rad", 50.0)
    assert variables["motor.tau"].causality == "input"
    assert variables["der(J2.omega)"].derivative is variables["J2.omega"]
    units = {one.name: one.baseUnit for one in description.unitDefinitions}
    mass_moment = units["kg*m^2"]
    assert (int(mass_moment.kg), int(mass_moment.m), int(mass_moment.s or 0)) == (1, 2, 0)


@pytest.mark.parametrize("version", VERSIONS)
def test_the_description_says_what_depends_on_what(unit: Units, version: str) -> None:
    description = fmpy.read_model_description(str(unit(version)))
    unknowns = [*description.derivatives, *description.outputs]
    read = {one.variable.name: {other.name for other in one.dependencies} for one in unknowns}
    assert read["der(J1.omega)"] == {"J1.omega", "J2.omega", "shaft.tau_c", "motor.tau"}
    assert read["der(shaft.tau_c)"] == {"J1.omega", "J2.omega"}
    assert read["J2.omega"] == {"J2.omega"}
    assert read["shaft.tau"] == {"J1.omega", "J2.omega", "shaft.tau_c"}


@pytest.mark.parametrize("version", VERSIONS)
def test_the_description_tells_bounds_and_usual_sizes(unit: Units, version: str) -> None:
    """The size of a torque is that of the impedance: sqrt(stiffness * median inertia) at a speed of 1 rad/s."""
    description = fmpy.read_model_description(str(unit(version)))
    variables = {variable.name: variable for variable in description.modelVariables}
    assert [float(variables[name].min) for name in ("J1.J", "shaft.c", "shaft.d")] == [0.0, 0.0, 0.0]
    assert (variables["shaft.c"].max, variables["J2.omega"].min, variables["J2.omega"].nominal) == (None, None, None)
    impedance = np.sqrt(50.0 * 2.25)
    assert float(variables["shaft.tau_c"].nominal) == pytest.approx(impedance, rel=1e-12)
    assert float(variables["motor.tau"].nominal) == 10.0
    sizes = {"J1.omega": 1.0, "J2.omega": 1.0, "shaft.tau_c": impedance}
    with instances(unit(version), "ModelExchange") as (one,):
        one.begin()
        names = [str(unknown.variable.derivative.name) for unknown in description.derivatives]
        assert one.nominals() == pytest.approx([sizes[name] for name in names], rel=1e-12)


@pytest.mark.parametrize(
    ("law", "first"),
    [
        (10.0 - 2.0 * sw.omega, 10.0),
        (sw.Table([0.0, 1.0], [3.0, 5.0])(sw.t), 3.0),
        (sw.Table([0.0, 9.0], [4.0, 0.0])(sw.omega), 4.0),
        (4.0 + sw.Step(-7.0, 0.5), 4.0),
        (sw.Step(5.0, 0.0), 5.0),
        (2.0 * sw.phi, 0.0),
    ],
)
def test_an_input_starts_at_the_first_value_of_its_law(tmp_path: Path, law: object, first: float) -> None:
    two_masses(law).compile().to_fmu(tmp_path / "unit.fmu", inputs=["motor.tau"], binary=False)
    description = fmpy.read_model_description(str(tmp_path / "unit.fmu"))
    (variable,) = (variable for variable in description.modelVariables if variable.name == "motor.tau")
    assert float(variable.start) == first


def test_names_that_are_no_identifiers_are_flat(tmp_path: Path) -> None:
    net = sw.Network("Zahnräder & Wellen <1>")
    net.add(sw.TorqueSource("Motor 1", tau=1.0), "Welle 1")
    net.add(sw.Inertia('Läufer "A"', J=2.0), "Welle 1")
    net.compile().to_fmu(tmp_path / "unit.fmu")
    assert validate_fmu(str(tmp_path / "unit.fmu")) == []
    description = fmpy.read_model_description(str(tmp_path / "unit.fmu"))
    assert description.variableNamingConvention == "flat"
    assert description.modelName == "Zahnräder & Wellen <1>"
    assert 'Läufer "A".J' in {variable.name for variable in description.modelVariables}


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", ["unit", "fmi3", "unit_config", "instance"])
def test_a_network_may_be_called_what_the_code_of_a_unit_uses(name: str, version: str, tmp_path: Path) -> None:
    net = sw.Network(name)
    net.add(sw.TorqueSource("motor", tau=1.0), "rotor")
    net.add(sw.Inertia("J", J=2.0), "rotor")
    net.compile().to_fmu(tmp_path / "any.fmu", version=version)
    assert fmpy.simulate_fmu(str(tmp_path / "any.fmu"), stop_time=1.0)["J.omega"][-1] == pytest.approx(0.5)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", KINDS)
def test_it_moves_as_the_network(unit: Units, version: str, kind: str) -> None:
    """Tolerated is some ten times what CVODE, of low order, leaves at a tolerance of 1e-10."""
    names = ["J1.omega", "J2.omega", "shaft.tau", "J2.tau"]
    seen = fmpy.simulate_fmu(
        str(unit(version)), fmi_type=kind, stop_time=2.0, output_interval=0.1, relative_tolerance=1e-10, output=names
    )
    motion = two_masses().simulate(2.0, rtol=1e-11, t_eval=seen["time"])
    for name in names:
        np.testing.assert_allclose(seen[name], motion[name], atol=2e-6 if kind == "ModelExchange" else 1e-8)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", KINDS)
def test_an_input_file_drives_it(unit: Units, version: str, kind: str) -> None:
    """Steps in the input are events: a sample just before and one at the same instant just after."""
    times, torques = [0.0, 0.5, 0.5, 1.2, 1.2, 2.0], [3.0, 3.0, -4.0, -4.0, 7.0, 7.0]
    signals = np.array(list(zip(times, torques, strict=True)), dtype=[("time", float), ("motor.tau", float)])
    seen = fmpy.simulate_fmu(
        str(unit(version)),
        fmi_type=kind,
        stop_time=2.0,
        output_interval=0.1,
        relative_tolerance=1e-10,
        input=signals,
        output=["J2.omega"],
    )
    law = 3.0 + sw.Step(-7.0, 0.5) + sw.Step(11.0, 1.2)
    motion = two_masses(law).simulate(2.0, rtol=1e-11, t_eval=np.unique(seen["time"]))
    last = [np.flatnonzero(seen["time"] == t)[-1] for t in np.unique(seen["time"])]
    np.testing.assert_allclose(seen["J2.omega"][last], motion["J2.omega"], atol=1e-6)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", KINDS)
def test_parameters_and_start_values_can_be_set(unit: Units, version: str, kind: str) -> None:
    seen = fmpy.simulate_fmu(
        str(unit(version)),
        fmi_type=kind,
        stop_time=1.0,
        output_interval=0.1,
        relative_tolerance=1e-10,
        start_values={"shaft.c": 80.0, "J2.J": 2.0, "J1.omega": 1.5, "motor.tau": -2.0},
        output=["J2.omega"],
    )
    changed = {"shaft.c": 80.0, "J2.J": 2.0}
    net = two_masses(-2.0)
    motion = net.simulate(1.0, rtol=1e-11, initial={"J1.omega": 1.5}, parameters=changed, t_eval=seen["time"])
    np.testing.assert_allclose(seen["J2.omega"], motion["J2.omega"], atol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_a_network_without_states_has_outputs_that_jump(kind: str, tmp_path: Path) -> None:
    net = sw.Network("prescribed")
    net.add(sw.SpeedSource("drive", omega=sw.Step(2.0, 0.25, before=1.0)), "shaft")
    net.add(sw.Damper("load", d=0.5), "shaft")
    net.compile().to_fmu(tmp_path / "unit.fmu", outputs=["load.tau"])
    seen = fmpy.simulate_fmu(
        str(tmp_path / "unit.fmu"), fmi_type=kind, stop_time=0.5, output_interval=0.1, record_events=False
    )
    np.testing.assert_allclose(seen["load.tau"], [0.5, 0.5, 0.5, 1.5, 1.5, 1.5], rtol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_a_sampled_controller_acts_at_its_instants(kind: str, tmp_path: Path) -> None:
    net = sw.Network("sampled")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.DryFriction("rubs", tau_c=1.0), "a")
    gains = {"A": [[1.0]], "B": [[0.1]], "C": [[1.0]], "D": [[3.0]]}
    net.add(sw.StateSpaceController("pi", **gains, measured=["J.omega"], reference=4.0, sample_time=0.1), "a")
    model = net.compile()
    model.to_fmu(tmp_path / "unit.fmu", outputs=["J.omega"])
    options = {"stop_time": 1.55, "output_interval": 0.05, "relative_tolerance": 1e-10, "record_events": False}
    seen = fmpy.simulate_fmu(str(tmp_path / "unit.fmu"), fmi_type=kind, **options)
    motion = model.simulate(1.55, rtol=1e-11, t_eval=seen["time"].clip(0, 1.55))
    np.testing.assert_allclose(seen["J.omega"], motion["J.omega"], atol=1e-6)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_restored_state_goes_on_to_the_same_bits(unit: Units, version: str) -> None:
    names = ("J1.omega", "J2.omega", "shaft.tau")
    with instances(unit(version), "CoSimulation", 2) as (one, other):
        one.begin()
        other.begin()
        for k in range(5):
            one.step(0.1 * k, 0.1)
        state = one.keep()
        data = one.serialised(state)
        one.set(motor__tau=99.0)
        one.step(0.5, 0.3)
        moved = one.get(*names)
        one.restore(state)
        one.step(0.5, 0.3)
        assert one.get(*names) != moved
        copy = other.deserialised(data)
        other.restore(copy)
        other.step(0.5, 0.3)
        assert other.get("time", *names) == one.get("time", *names)
        one.drop(state)
        other.drop(copy)


@pytest.mark.parametrize("version", VERSIONS)
def test_two_instances_do_not_disturb_each_other(unit: Units, version: str) -> None:
    with instances(unit(version), "CoSimulation", 3) as (alone, one, other):
        for instance, torque in ((alone, 3.0), (one, 3.0), (other, -8.0)):
            instance.begin(motor__tau=torque)
        alone.step(0.0, 0.1)
        alone.step(0.1, 0.1)
        for t in (0.0, 0.1):
            other.step(t, 0.1)
            one.step(t, 0.1)
        assert one.get("J2.omega", "shaft.tau") == alone.get("J2.omega", "shaft.tau")
        assert other.get("J2.omega")[0] < 0.0 < one.get("J2.omega")[0]


@pytest.mark.parametrize("version", VERSIONS)
def test_rates_and_slopes_are_those_of_the_model(unit: Units, version: str) -> None:
    model = two_masses().compile()
    x = [0.3, -0.7, 2.0]
    with instances(unit(version), "ModelExchange") as (one,):
        one.begin()
        order = [str(unknown.variable.derivative.name) for unknown in one.description.derivatives]
        places = [model.states.index(name) for name in order]
        ours = np.array(x)[np.argsort(places)] if places != [0, 1, 2] else np.array(x)
        states = [ours[place] for place in places]
        np.testing.assert_allclose(one.rates(0.0, states), model.rhs(0.0, ours)[places], rtol=1e-13)
        rates = [f"der({name})" for name in order]
        jacobian = model.jacobian(0.0, ours).toarray()[np.ix_(places, places)]
        for k, name in enumerate(order):
            np.testing.assert_allclose(one.slope(rates, [name], [1.0]), jacobian[:, k], rtol=1e-13, atol=1e-13)
        along = one.slope(rates, order, [1.0, 2.0, 3.0])
        np.testing.assert_allclose(along, jacobian @ [1.0, 2.0, 3.0], rtol=1e-12)
        # an output and an input: central differences, good to ten digits
        assert one.slope(["der(J1.omega)", "J2.tau"], ["motor.tau"], [2.0]) == pytest.approx([2.0 / 1.5, 0.0], abs=1e-8)


@pytest.mark.parametrize("version", VERSIONS)
def test_wrong_calls_are_errors_that_leave_the_instance_usable(unit: Units, version: str) -> None:
    with instances(unit(version), "CoSimulation") as (one,):
        one.begin()
        for wrong in (
            lambda: one.set(J2__tau=1.0),
            lambda: one.set(shaft__c=float("nan")),
            lambda: one.set(J2__omega=1.0),
            lambda: one.step(0.7, 0.1),
            lambda: one.step(0.0, -0.1),
            lambda: one._get([9999]),
            lambda: one.slope(["shaft.c"], ["J2.omega"], [1.0]),
            lambda: one.slope(["der(J2.omega)"], ["J2.tau"], [1.0]),
        ):
            with pytest.raises(Exception, match="failed with status 3"):
                wrong()
        one.step(0.0, 0.1)
        assert one.get("time") == [pytest.approx(0.1)]


@pytest.mark.parametrize("version", VERSIONS)
def test_its_source_code_compiles_without_a_warning(unit: Units, version: str, tmp_path: Path) -> None:
    with zipfile.ZipFile(unit(version)) as archive:
        archive.extractall(tmp_path)
        sources = [name for name in archive.namelist() if name.endswith(".c")]
    description = fmpy.read_model_description(str(unit(version)))
    (configuration,) = description.buildConfigurations
    (listed,) = configuration.sourceFileSets
    assert sorted(f"sources/{name}" for name in listed.sourceFiles) == sorted(sources)
    for compiler in filter(shutil.which, ("gcc", "clang")):
        flags = STRICT if compiler == "gcc" else [flag for flag in STRICT if flag != "-Wconversion"]
        subprocess.run([compiler, *flags, "-c", *(str(tmp_path / s) for s in sources)], check=True, cwd=tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
@pytest.mark.parametrize("net", [two_masses(), sw.scenes.crane(gap=0.01)], ids=lambda net: net.name)
def test_a_thousand_instances_leave_nothing_behind(net: sw.Network, tmp_path: Path) -> None:
    path = tmp_path / "unit.fmu"
    net.compile().to_fmu(path, version="2.0", outputs=[], binary=False)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
        sources = [str(tmp_path / name) for name in archive.namelist() if name.endswith(".c")]
    token = fmpy.read_model_description(str(path)).guid
    (tmp_path / "main.c").write_text(MAIN.replace("TOKEN", f'"{token}"'))
    program = str(tmp_path / "main")
    subprocess.run(["gcc", "-g", "-O1", *sources, str(tmp_path / "main.c"), "-lm", "-o", program], check=True)
    options = ["--leak-check=full", "--show-leak-kinds=all", "--errors-for-leak-kinds=all", "--error-exitcode=3", "-q"]
    subprocess.run(["valgrind", *options, program], check=True, capture_output=True)


def test_the_same_network_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("one.fmu", "other.fmu"):
        two_masses().compile().to_fmu(tmp_path / name, binary=False)
    assert (tmp_path / "one.fmu").read_bytes() == (tmp_path / "other.fmu").read_bytes()


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"version": "1.0"}, sw.ParameterError, "none of: 3.0, 2.0"),
        ({"kind": "me"}, sw.ParameterError, "none of: 'both', 'model exchange', 'co-simulation'"),
        ({"inputs": ["motor.taw"]}, sw.ParameterError, "motor.tau"),
        ({"outputs": ["J9.omega"]}, sw.SignalError, "J9.omega"),
        ({"outputs": "J2.omega"}, sw.ParameterError, "list of names"),
        ({"t_end": 0.0}, sw.ParameterError, "t_end"),
    ],
)
def test_wrong_arguments_are_answered_with_what_exists(
    tmp_path: Path, options: dict[str, object], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        two_masses().compile().to_fmu(tmp_path / "unit.fmu", **options)
    assert not list(tmp_path.iterdir())
    with pytest.raises(sw.ParameterError, match="no folder"):
        two_masses().compile().to_fmu(tmp_path / "none" / "unit.fmu")


def test_without_a_compiler_there_are_sources_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    model = two_masses().compile()
    with pytest.raises(sw.CompileError, match="binary=False"):
        model.to_fmu(tmp_path / "unit.fmu")
    model.to_fmu(tmp_path / "unit.fmu", binary=False)
    with zipfile.ZipFile(tmp_path / "unit.fmu") as archive:
        assert not [name for name in archive.namelist() if name.startswith("binaries")]


def test_waves_are_refused_by_name(tmp_path: Path) -> None:
    net = two_masses()
    net.add(sw.Shaft("line", length=10.0, diameter=0.1, model=sw.Wave()), "wheel", "far")
    net.add(sw.Inertia("J3", J=2.0), "far")
    with pytest.raises(sw.CompileError, match="travelling waves"):
        net.compile().to_fmu(tmp_path / "unit.fmu")


def test_our_own_unit_is_a_part_of_a_network(tmp_path: Path) -> None:
    """Half of a train goes to an FMU and comes back: its end is held by a prescribed speed, an input of the unit."""
    half = sw.Network("half")
    half.add(sw.SpeedSource("drive", omega=0.0), "flange")
    half.add(sw.Spring("shaft", c=50.0), "flange", "wheel")
    half.add(sw.Inertia("J2", J=3.0), "wheel")
    half.compile().to_fmu(tmp_path / "half.fmu", inputs=["drive.omega"])
    net = sw.Network("with a unit")
    net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    net.add(sw.Inertia("J1", J=1.5), "rotor")
    net.add(
        sw.FMUTorque("rest", fmu=sw.FMU(tmp_path / "half.fmu", speed="drive.omega", torque="shaft.tau"), gain=-1.0),
        "rotor",
    )
    whole = sw.Network("whole")
    whole.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    whole.add(sw.Inertia("J1", J=1.5), "rotor")
    whole.add(sw.Spring("shaft", c=50.0), "rotor", "wheel")
    whole.add(sw.Inertia("J2", J=3.0), "wheel")
    motion = net.simulate(2.0, rtol=1e-10)
    np.testing.assert_allclose(motion["J1.omega"], whole.simulate(2.0, rtol=1e-10)["J1.omega"], atol=1e-7)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_description_with_wrong_attributes_is_read_or_refused_by_name(
    unit: Units, version: str, tmp_path: Path
) -> None:
    chance, path = Random(1), tmp_path / "mutated.fmu"  # noqa: S311 (no secret)
    with zipfile.ZipFile(unit(version)) as archive:
        text = archive.read("modelDescription.xml")
    values = ("", "0", "-1", "1e400", "nan", "x", "true", "input", "output", "m/s", "99999")
    for _ in range(40):
        root = ET.fromstring(text)  # noqa: S314 (of our own making)
        element = chance.choice([one for one in root.iter() if one.attrib])
        element.set(chance.choice(list(element.attrib)), chance.choice(values))
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("modelDescription.xml", ET.tostring(root))
        with contextlib.suppress(sw.ParameterError):
            assert len(sw.FMU(path, speed="J1.omega", torque="motor.tau").states) <= 3


def test_a_folder_is_no_place_for_a_unit(tmp_path: Path) -> None:
    net = sw.Network("wheel")
    net.add(sw.Inertia("J", J=1.0), "a")
    for place in (tmp_path, "."):
        with pytest.raises(sw.ParameterError, match="is a folder"):
            net.compile().to_fmu(place)


def test_a_quantity_named_like_a_parameter_is_told_from_it(tmp_path: Path) -> None:
    """The torque of a load is `load.tau`, and so is its largest one, a parameter."""
    net = sw.Network("held")
    net.add(sw.TorqueSource("motor", tau=20.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.CoulombLoad("load", tau=30.0), "a")
    for outputs in (None, ["load.tau"]):
        net.compile().to_fmu(tmp_path / "held.fmu", outputs=outputs)
        rows = fmpy.simulate_fmu(tmp_path / "held.fmu", stop_time=0.1, output=["load.tau_now"], start_values={})
        assert rows["load.tau_now"][-1] == -20.0
