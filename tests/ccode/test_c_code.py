"""Exported C code says and moves as the library does."""

from __future__ import annotations

import shutil
import subprocess
import warnings
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.ccode.c_export import c_code, c_name
from shaftwork.core.errors import CompileError
from shaftwork.scenes import SCENES
from tests.beds import bed_of
from tests.ccode.library import STRICT, Library
from tests.coupled import COUPLED
from tests.properties.examples import compiled, share_of_examples
from tests.properties.test_hybrid_reference import RESTS, Draw, end, network
from tests.strategies import Network, networks

RTOL = 1e-12
MOTION = 1e-9
"""Of the largest value: two methods with a tolerance of 1e-12 differ by some hundred times that after many periods."""


def two_masses(tau: object = 5.0) -> sw.Network:
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=tau), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=100.0, d=0.3), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    net.add(sw.ViscousLoad("load", d=0.7), "b")
    return net


def crane() -> sw.Network:
    return SCENES["crane"]()


def difference(library: Library, sol: sw.Solution) -> float:
    """The largest difference of an output now from the end of a motion, as part of its largest value."""
    outputs = library.outputs()
    return max(abs(value - sol[name][-1]) / max(np.abs(sol[name]).max(), 1e-3) for name, value in outputs.items())


@given(networks(max_inertias=12))
@share_of_examples(0.2)
def test_rates_and_slopes_are_those_of_the_library_and_so_is_the_motion(pieces: Network) -> None:
    assert_agrees(compiled(pieces))


@pytest.mark.parametrize("build", COUPLED.values(), ids=COUPLED)
def test_many_that_determine_each_other_are_solved_for(build: Callable[[int], sw.Network]) -> None:
    assert_agrees(build(1).compile())


def assert_agrees(model: sw.Model) -> None:
    """Rates, slopes and a motion are those of the library."""
    size = len(model.states)
    with TemporaryDirectory() as folder:
        library = Library(c_code(model), Path(folder))
        x = np.random.default_rng(0).normal(size=size)
        rates, slopes = model.rhs(0.3, x), model.jacobian(0.3, x).toarray()
        library.struct.since, library.struct.until = 0.0, 1.0
        # a rate is a sum of what may be larger than all rates
        largest = max(np.abs(rates).max(), (np.abs(slopes) @ np.abs(x)).max())
        assert np.abs(library.read("rhs", 0.3, x, size) - rates).max() <= 1e-13 * largest
        told = library.read("jacobian", 0.3, x, size**2).reshape(size, size)
        assert np.abs(told - slopes).max() <= 1e-13 * np.abs(slopes).max()
        library.call("start", 0.0)
        library.call("integrate", 0.3, RTOL)
        # reactions are differences of large torques
        assert difference(library, model.simulate(0.3, rtol=RTOL, t_eval=50)) < 100 * MOTION


@pytest.mark.slow
@given(st.integers(0, 10**6))
@share_of_examples(0.5)
def test_a_random_train_that_switches_ends_as_in_the_library(seed: int) -> None:
    train = Draw(seed).train()
    with warnings.catch_warnings(), TemporaryDirectory() as folder:
        warnings.simplefilter("ignore", sw.NetworkWarning)  # parts may be loose of each other
        library = Library(c_code(network(train).compile()), Path(folder))
        for k, speed in enumerate(train.speeds):
            library.struct.start[library.code.stores.index(f"J{k}.omega")] = speed
        library.call("start", 0.0)
        library.call("integrate", train.t_end, RTOL)
        wanted, outputs = end(train), library.outputs()
    speeds = np.array([outputs[f"J{k}.omega"] for k in range(len(train.speeds))])
    uncertain = RESTS * any(joint.restitution for joint in train.joints)
    assert np.abs(speeds - wanted).max() < MOTION * max(1.0, np.abs(wanted).max()) + uncertain


QUICK = ("crane-start", "crane")


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in SCENES]
)
def test_scenes_move_as_in_the_library(name: str, tmp_path: Path) -> None:
    scene = SCENES[name]
    model, t_end = scene().compile(), scene.t_end / (1 if name in (*QUICK, "six-phases") else 10)
    library = Library(c_code(model), tmp_path)
    library.call("integrate", t_end, 0.01 * RTOL)  # shafts without damping swing thousands of times
    sol = model.simulate(t_end, rtol=RTOL, t_eval=200)
    largest = [max(np.abs(sol[variable.name]).max(), 1e-3) for variable in library.code.states]
    wanted = [sol[variable.name][-1] for variable in library.code.states]
    assert (np.abs(library.x - wanted) / largest).max() < MOTION
    if model.phased:
        assert library.modes == [*sol.phases[-1].modes.values()]


@pytest.mark.parametrize(
    "name",
    [
        "TableMotor",
        "CageMotor",
        "RandomLoad",
        "SpeedController",
        "Switch",
        "Diode",
        pytest.param("BLDCMotor", marks=pytest.mark.slow),
    ],
)
def test_tables_noise_controllers_and_diodes_move_as_in_the_library(name: str, tmp_path: Path) -> None:
    model = bed_of(name).compile()
    library = Library(c_code(model), tmp_path)
    library.call("start", 0.0)
    library.call("integrate", 1.0, RTOL)
    sol = model.simulate(1.0, rtol=RTOL, t_eval=100)
    for variable, value in zip(library.code.states, library.x.tolist(), strict=True):
        assert value == pytest.approx(sol[variable.name][-1], abs=MOTION * max(1e-3, np.abs(sol[variable.name]).max()))


def test_pulses_and_noise_of_the_time_end_steps(tmp_path: Path) -> None:
    """Laws that jump at known times lose no digits there."""
    law = (
        sw.Step(3.0, 0.25)
        - sw.Ramp(2.0, 0.2, 0.5)
        + sw.HeldNoise(sw.t / 0.05, 7)
        + sw.Table([0, 0.3, 0.9], [0, 4, 1])(sw.t)
    )
    model = two_masses(law + sw.SmoothNoise(sw.t / 0.1, 3)).compile()
    library = Library(c_code(model), tmp_path)
    library.call("integrate", 0.98, RTOL)
    assert difference(library, model.simulate(0.98, rtol=RTOL, t_eval=50)) < MOTION
    assert library.struct.events >= 19  # one for each number of the noise at least


def test_inputs_take_the_place_of_laws(tmp_path: Path) -> None:
    library = Library(c_code(two_masses(sw.Step(5.0, 0.1)).compile(), inputs=["motor.tau"]), tmp_path)
    assert [(variable.name, variable.unit, variable.value) for variable in library.code.inputs] == [
        ("motor.tau", "N*m", 0.0)
    ]
    library.struct.u[0] = 5.0
    library.call("integrate", 0.4, RTOL)
    assert difference(library, two_masses(5.0).compile().simulate(0.4, rtol=RTOL, t_eval=50)) < MOTION


def test_parameters_are_changed_without_compiling(tmp_path: Path) -> None:
    model = crane().compile()
    library = Library(c_code(model), tmp_path)
    names = [variable.name for variable in library.code.parameters]
    library.struct.p[names.index("brake.tau")] = 60.0
    library.call("start", 0.0)
    library.call("integrate", 10.0, RTOL)
    sol = model.simulate(10.0, rtol=RTOL, t_eval=200, parameters={"brake.tau": 60.0})
    assert difference(library, sol) < MOTION


def test_an_instance_is_saved_and_restored_as_it_is(tmp_path: Path) -> None:
    """A struct without pointers: its bytes are its state, and two of them know nothing of each other."""
    library = Library(c_code(crane().compile()), tmp_path)
    library.call("integrate", 3.0, RTOL)
    saved = type(library.struct).from_buffer_copy(library.struct)
    library.call("integrate", 10.0, RTOL)
    first, modes = library.x, library.modes
    library.struct = saved
    assert library.struct.t == 3.0
    library.call("integrate", 10.0, RTOL)
    assert library.x.tolist() == first.tolist()
    assert library.modes == modes


def test_fixed_steps_follow_the_modes(tmp_path: Path) -> None:
    """Events are found within steps; those of 10 ms at the 4 Hz of the crane lose nothing by order 8."""
    model = crane().compile()
    library = Library(c_code(model), tmp_path)
    while library.struct.t < 10.0 - 1e-9:
        library.call("step", 1e-2)
    sol = model.simulate(10.0, rtol=RTOL, t_eval=200)
    assert library.modes == [*sol.phases[-1].modes.values()]
    assert difference(library, sol) < MOTION


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_the_example_compiles_silently_and_writes_rows(compiler: str, tmp_path: Path) -> None:
    if shutil.which(compiler) is None:
        pytest.skip(f"{compiler} is not installed")
    crane().compile().to_c(tmp_path, name="hoist", outputs=["J2.omega", "shaft.tau"])
    command = [compiler, *STRICT, "-O2", "-o", "run", "hoist.c", "main.c", "-lm"]
    told = subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True)
    assert told.stderr == ""
    rows = subprocess.run([tmp_path / "run"], check=True, capture_output=True, text=True).stdout.splitlines()
    assert rows[0] == "t,J2.omega,shaft.tau"
    assert len(rows) == 1002
    assert rows[-1].startswith("10,0,")


def test_the_same_network_gives_the_same_bytes() -> None:
    first, second = (c_code(crane().compile()) for _ in range(2))
    assert (first.header, first.source, first.example) == (second.header, second.source, second.example)


def test_names_of_networks_become_names_in_c() -> None:
    assert c_name("crane train 2") == "crane_train_2"
    assert c_name("2 Massen, größer") == "model_2_Massen_gr_er"
    assert c_name("double") == "double_model"
    assert c_name("机") == "model"
    assert c_name("m") == "m_model"  # the code calls an instance m
    assert c_name("sin") == "sin_model"


@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        ({"name": "two words"}, sw.ParameterError, "must be a name in C"),
        ({"name": "int"}, sw.ParameterError, "nothing that the code itself"),
        ({"inputs": ["J1.J"]}, sw.ParameterError, "There are: 'motor.tau'"),
        ({"inputs": [3]}, sw.ParameterError, "3 is no name"),
        ({"outputs": ["J1.power"]}, sw.SignalError, "is an energy, a power"),
        ({"outputs": ["J9.omega"]}, sw.SignalError, "does not exist"),
    ],
)
def test_wrong_names_are_refused(arguments: dict[str, object], kind: type[Exception], words: str) -> None:
    with pytest.raises(kind, match=words):
        c_code(two_masses().compile(), **arguments)  # type: ignore[arg-type]


def test_what_has_no_code_is_refused_by_name() -> None:
    waves = sw.Network("waves")
    waves.add(sw.Inertia("J1", J=1.0), "a")
    waves.add(sw.Shaft("line", length=3.0, diameter=0.05, model=sw.Wave()), "a", "b")
    waves.add(sw.Inertia("J2", J=1.0), "b")
    with pytest.raises(CompileError, match="travelling waves"):
        c_code(waves.compile())
    stopped = lossy()
    stopped.add(sw.HardStop("stop", upper=0.1), "b")
    with pytest.raises(
        CompileError, match="'gear' of 'train' loses power by the direction of its torque, beside 'stop'"
    ):
        c_code(stopped.compile())
    many = sw.Network("many")
    for k in range(9):
        many.add(sw.Inertia(f"J{k}", J=1.0), f"n{k}")
        many.add(sw.DryFriction(f"rubs{k}", tau_c=1.0), f"n{k}", f"n{(k + 1) % 9}")
    with pytest.raises(CompileError, match="'many' has 512 sets of equations"):
        c_code(many.compile())
    rigid = sw.Network("rigid")
    rigid.add(sw.SpeedSource("drive", omega=3.0), "a")
    rigid.add(sw.Inertia("J1", J=1.0), "a")
    rigid.add(sw.Spring("shaft", c=10.0, d=0.1), "a", "b")
    rigid.add(sw.Inertia("J2", J=1.0), "b")
    with pytest.raises(CompileError, match=r"'drive\.omega' turns an inertia rigidly"):
        c_code(rigid.compile(), inputs=["drive.omega"])


def lossy() -> sw.Network:
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=3 * sympy.sin(sw.t)), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.LossyGear("gear", ratio=2.0, efficiency=0.9), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    return net


def test_gears_that_rub_turn_round_as_in_the_library(tmp_path: Path) -> None:
    net = lossy()
    net.add(sw.DryFriction("rubs", tau_c=0.5), "b")
    model = net.compile()
    library = Library(c_code(model), tmp_path)
    library.call("integrate", 8.0, RTOL)
    assert difference(library, model.simulate(8.0, rtol=RTOL, t_eval=50)) < MOTION
    assert library.struct.events > 2


def test_a_motion_that_is_too_stiff_says_so(tmp_path: Path) -> None:
    library = Library(c_code(bed_of("BucketWheelLoad").compile()), tmp_path)
    library.struct.most_steps = 1000
    with pytest.raises(AssertionError, match="the motion is stiff"):
        library.call("integrate", 2.0, RTOL)


def geared() -> sw.Network:
    net = sw.Network("geared")
    net.add(sw.Inertia("J1", J=1.0), "fast")
    net.add(sw.Gear("gear", ratio=2.0), "fast", "slow")
    net.add(sw.Inertia("J2", J=4.0), "slow")
    net.add(sw.Damper("bearing", d=0.1), "slow")
    return net


def test_the_start_value_of_a_state_counts_whatever_a_gear_ties_to_it(tmp_path: Path) -> None:
    library = Library(c_code(geared().compile()), tmp_path)
    library.struct.start[library.code.stores.index("J1.omega")] = 10.0
    library.call("start", 0.0)
    assert library.outputs()["J2.omega"] == pytest.approx(5.0, rel=1e-15)
    library.struct.start[library.code.stores.index("J2.omega")] = 5.0  # as it follows
    library.call("start", 0.0)
    assert library.outputs()["J2.omega"] == pytest.approx(5.0, rel=1e-15)


def test_start_values_that_contradict_each_other_are_a_fault(tmp_path: Path) -> None:
    library = Library(c_code(geared().compile()), tmp_path)
    library.struct.start[library.code.stores.index("J2.omega")] = 7.0
    with pytest.raises(Exception, match="start values contradict each other"):
        library.call("start", 0.0)
