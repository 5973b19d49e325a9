"""Modelica models as networks: files of the Modelica Standard Library, round trips, and what is refused by line."""

from __future__ import annotations

import random
import re
import warnings
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

import shaftwork as sw
from tests.properties.examples import network_of, processor_time_limit, share_of_examples
from tests.strategies import Network as Pieces
from tests.strategies import networks

FILES = Path(__file__).parent / "msl"
"""Examples of the Modelica Standard Library 4.1 as they are, under the BSD licence beside them."""

# What rumoca 0.10.2 with the whole Modelica Standard Library makes of the files at tolerances of 1e-10.
MOTIONS = {
    "First": (0.5, {"inertia1.omega": 3.719950759963881, "inertia3.omega": 0.472063694419961}),
    "Backlash": (
        0.5,
        {
            "inertia1.omega": -0.8807429778227553,
            "inertia2.omega": -17.22842566446283,
            "inertia3.omega": -16.007804991193467,
        },
    ),
    "ElasticBearing": (
        10.0,
        {
            "shaft.omega": 114.46280167993098,
            "load.omega": 38.13223189920358,
            "housing.omega": -0.000147079667766113,
        },
    ),
    "Oscillator": (1.0, {"mass1.v": -0.25317459818823906, "mass2.v": -0.050222532654799736}),
    "WhyArrows": (1.0, {"mass1.v": 0.5198006896840517, "inertia2.v": 0.5198006896840517}),
    "CauerLowPassAnalog": (30.0, {"C1.u": 0.5006486274433017, "C5.u": 0.5006300563037159}),
}
OF_RUMOCA = 2e-5
"""By how much its result at 1e-8 is off from that at 1e-10, relative, at most twice."""

TRAIN = """model Train
  parameter Real J = 2;
  parameter Modelica.Units.SI.Inertia load = 3*J + sqrt(4)^2/2 "kg m2";
  Modelica.Mechanics.Rotational.Components.Inertia J1(J = J, w(start = 3, fixed = true));
  Modelica.Mechanics.Rotational.Components.SpringDamper shaft(c = 1e2, d = 1);
  Modelica.Mechanics.Rotational.Components.Inertia J2(J = load);
equation
  connect(J1.flange_b, shaft.flange_a);
  connect(shaft.flange_b, J2.flange_a);
  annotation(experiment(StopTime = 2));
end Train;
"""


@pytest.mark.parametrize("name", MOTIONS)
def test_files_of_the_library_move_as_another_tool_has_them(name: str) -> None:
    model, (time, values) = sw.read_modelica(FILES / f"{name}.mo"), MOTIONS[name]
    motion = model.simulate(t_eval=[0.0, time])
    for quantity, value in values.items():
        assert motion[quantity][-1] == pytest.approx(value, rel=OF_RUMOCA, abs=1e-6)


def test_a_vehicle_runs_up_to_the_speed_at_which_the_wind_takes_all_force() -> None:
    """From 0.1 s on 2 kg are pushed by 10 N, less 10 N at the square of v / 5 m/s."""
    t = np.linspace(0.0, 5.0, 51)
    motion = sw.read_modelica(FILES / "RollingWheel.mo").simulate(t_eval=t)
    np.testing.assert_allclose(motion["mass.v"], 5 * np.tanh(np.maximum(0.0, t - 0.1)), rtol=1e-8, atol=1e-9)


def test_parameters_start_values_and_the_end_are_read() -> None:
    model = sw.read_modelica(TRAIN)
    assert [placed.part for placed in model.network.netlist().placed] == [
        sw.Inertia("J1", J=2.0),
        sw.Spring("shaft", c=100.0, d=1.0),
        sw.Inertia("J2", J=8.0),
    ]
    assert model.initial == {"J1.omega": 3.0}
    assert model.t_end == 2.0
    motion = model.simulate()
    # the momentum 2 * 3 stays, and both turn together in the end
    assert 2 * motion["J1.omega"][-1] + 8 * motion["J2.omega"][-1] == pytest.approx(6.0, rel=1e-9)


def test_a_function_that_nothing_calls_changes_nothing() -> None:
    function = """function f
  input Real x;
  output Real y;
algorithm
  y := x;
  while y > 1 loop
    if y > 2 then y := y - 1; else y := y / 2; end if;
  end while;
end f;
"""
    assert sw.read_modelica(function + TRAIN).network.netlist() == sw.read_modelica(TRAIN).network.netlist()


def test_a_file_without_an_experiment_needs_an_end() -> None:
    model = sw.read_modelica(TRAIN.replace("annotation(experiment(StopTime = 2));", ""))
    with pytest.raises(sw.ModelFileError, match="Give t_end"):
        model.simulate()
    assert model.simulate(0.5).t[-1] == 0.5


def test_signals_of_blocks_are_laws_of_time() -> None:
    text = TRAIN.replace(
        "equation",
        """  Modelica.Mechanics.Rotational.Sources.Torque torque;
  Modelica.Blocks.Sources.RealExpression push(y = if time < 0.5 then 4*time else 2);
equation
  connect(push.y, torque.tau);
  connect(torque.flange, J1.flange_a);""",
    )
    motion = sw.read_modelica(text).simulate()
    total = 2 * motion["J1.omega"][-1] + 8 * motion["J2.omega"][-1]
    assert total == pytest.approx(6.0 + 0.5 + 3.0, rel=1e-9)  # and the impulse of the torque, 4 t then 2


@pytest.mark.parametrize("ratio", [-2.0, 0.4, 3.0])
def test_a_gear_on_a_support_that_moves_is_planetary(ratio: float) -> None:
    text = f"""model Supported
  Modelica.Mechanics.Rotational.Components.IdealGear gear(ratio = {ratio}, useSupport = true);
  Modelica.Mechanics.Rotational.Components.Inertia a(J = 1);
  Modelica.Mechanics.Rotational.Components.Inertia b(J = 2);
  Modelica.Mechanics.Rotational.Components.Inertia s(J = 3);
  Modelica.Mechanics.Rotational.Sources.ConstantTorque push(tau_constant = 1);
equation
  connect(gear.flange_a, a.flange_a);
  connect(gear.flange_b, b.flange_a);
  connect(gear.support, s.flange_a);
  connect(push.flange, a.flange_b);
end Supported;
"""
    motion = sw.read_modelica(text).simulate(1.0)
    a, b, s = (motion[f"{name}.omega"][-1] for name in "abs")
    assert a - s == pytest.approx(ratio * (b - s), rel=1e-9)
    assert a + 2 * b + 3 * s == pytest.approx(1.0, rel=1e-9)  # the gear stands on nothing outside: momentum is kept
    with pytest.raises(sw.ModelFileError, match="line 2: the support of 'gear' is joined to nothing"):
        sw.read_modelica(text.replace("  connect(gear.support, s.flange_a);\n", ""))


@share_of_examples(1.0)
@given(networks(max_inertias=8, electrical=False))
def test_what_is_written_is_read_again(pieces: Pieces) -> None:
    net = network_of(pieces)
    again = sw.read_modelica(net.to_modelica()).network
    names = [f"{placed.part.name}.omega" for placed in net.netlist().placed if isinstance(placed.part, sw.Inertia)]
    here, there = net.simulate(0.5, t_eval=11), again.simulate(0.5, t_eval=11)
    size = max(np.max(np.abs(here[name])) for name in names)
    for name in names:  # both runs keep 1e-8
        assert np.max(np.abs(here[name] - there[name])) <= 1e-6 * size


REFUSALS = [
    ("  connect(J1.flange_b", "  J1.phi = 0;\n  connect(J1.flange_b", 8, r"an equation is not read\. Read are"),
    (
        "  connect(J1.flange_b",
        "  when time > 1 then\n    J1.w = 0;\n  end when;\n  connect(J1.flange_b",
        8,
        "a when equation",
    ),
    (
        "  connect(J1.flange_b",
        "  for k in 1:3 loop\n    x[k] = 0;\n  end for;\n  connect(J1.flange_b",
        8,
        "a for loop is",
    ),
    (
        "equation",
        "algorithm\n  if time > 1 then\n    x := if a then b else c;\n  end if;\n  while x < 3 loop\n    x := x + 1;\n"
        "  end while;\nequation",
        7,
        "an algorithm section is not read",
    ),
    ("equation", "  while x < 3 loop\n  end while;\nequation", 7, "'while' stands where declarations do"),
    ("J = 2", "J = f(2)", 2, "the function 'f' is not read"),
    ("J2(J = load)", "J2(J = lead)", 6, r"there is no parameter 'lead'. There are: J, load"),
    ("J2(J = load)", "J2(m = load)", 6, r"'J2' has no parameter 'm' that is read. It has: J"),
    ("J2(J = load)", "J2", 6, r"'J2' has no value of 'J'"),
    ("J2(J = load)", "J2(J = load, a(fixed = true))", 6, r"a fixed start of 'a' is not read"),
    ("J2(J = load)", "J2[3](each J = load)", 6, r"'J2' is an array of parts"),
    ("Components.Inertia J2(J = load)", "Components.Gearbox J2(c = 1)", 6, r"'J2' is of the class '.*Gearbox'"),
    ("3*J + ", "3*J + der(", 3, r"'\)' is expected, and there is"),
    ("3*J + ", "3*load + ", 3, r"the parameter 'load' is its own value"),
    ("3*J + ", "3/(J - 2) + ", 3, r"the expression has no"),
    ("3*J + ", "1e99*1e99*J + ", 3, r"the number 1e\+198 is too large"),
    ("3*J + ", "foo(J) + ", 3, r"the function 'foo' is not read"),
    ("J2.flange_a", "J2.flange_c", 9, r"there is no connector 'J2.flange_c'"),
    ("J2.flange_a", "J4.flange_a", 9, r"there is no connector 'J4.flange_a'"),
    ("end Train;", "end Tram;", 11, r"'end Train' is expected, and there is 'end Tram'"),
    ("(StopTime", "(StartTime = 1, StopTime", 10, r"another StartTime than 0 is not read"),
    ("end Train;", "", 1, r"'Train' has no end"),
    ("model Train", "model Train\n  extends Other;", 2, r"it extends 'Other'"),
    ("equation", "initial equation\n  J1.w = 1;\nequation", 7, r"an initial equation section is not read"),
    ("equation", "  Real x;\nequation", 7, r"the variable 'x' is not read"),
    ("equation", "algorithm\n  x := 1;\nequation", 7, r"an algorithm section is not read"),
    ("J = J,", "J = J, $", 4, r"'\$' begins nothing that Modelica has"),
]


@pytest.mark.parametrize(("old", "new", "line", "message"), REFUSALS, ids=[new.strip()[:24] for _, new, *_ in REFUSALS])
def test_what_is_not_read_is_refused_with_its_line(old: str, new: str, line: int, message: str) -> None:
    with pytest.raises(sw.ModelFileError, match=rf"^Modelica text: line {line}: .*({message})"):
        sw.read_modelica(TRAIN.replace(old, new, 1)).network.compile()


def test_files_of_the_library_with_other_parts_are_refused_with_their_line() -> None:
    with pytest.raises(sw.ModelFileError, match=r"CoupledClutches\.mo: line 16: 'clutch1': its friction changes"):
        sw.read_modelica(FILES / "CoupledClutches.mo")


def test_a_wrong_value_is_named_with_its_line() -> None:
    model = sw.read_modelica(TRAIN.replace("c = 1e2", "c = -1e2"))
    with pytest.raises(sw.NetworkError, match=r"c = -100\.0 must be at least 0 \(Modelica text, line 5\)"):
        model.network.compile()


def test_a_part_called_ground_is_called_frame() -> None:
    text = TRAIN.replace(
        "equation",
        "  Modelica.Mechanics.Rotational.Components.Fixed ground;\nequation\n  connect(ground.flange, J2.flange_b);",
    )
    model = sw.read_modelica(text)
    assert model.network.netlist().placed[-1].part == sw.Ground("frame")
    assert model.simulate()["J2.omega"][-1] == 0.0


def test_one_of_several_models_is_named() -> None:
    both = TRAIN + TRAIN.replace("Train", "Other").replace("J = 2;", "J = 5;")
    with pytest.raises(sw.ModelFileError, match=r"2 models to choose from\. Name one of: Train, Other"):
        sw.read_modelica(both)
    assert sw.read_modelica(both, "Other").network.netlist().placed[0].part == sw.Inertia("J1", J=5.0)
    with pytest.raises(sw.ModelFileError, match="there is no such model"):
        sw.read_modelica(both, "Third")


@pytest.mark.parametrize("source", ["nowhere.mo", "", 7, "a\0b"])
def test_what_is_no_file_is_refused(source: object) -> None:
    with pytest.raises(sw.ModelFileError, match=r"cannot be read|neither the path"):
        sw.read_modelica(source)  # type: ignore[arg-type]


def mutated(text: str, chance: random.Random) -> str:
    """A text with one to four changes: something left out, put in, repeated, exchanged, or another number."""
    for _ in range(chance.choice((1, 1, 2, 4))):
        words = re.findall(r"\w+|[^\w\s]", text) or ["x"]
        begin = chance.randrange(len(text) + 1)
        end = begin + chance.randrange(1, 30)
        values = ["0", "-1", "1e400", "1/0", "9^9^9^9", "(0-1)^0.5", "true", "time", "{1}", '"x"', "log(0)"]
        numbers = [*values, "(" * 5000]
        middle = chance.choice(["", chance.choice("(){}[];,=\\é"), text[begin:end] * 3, *words[:3], *numbers[:3]])
        text = text[:begin] + chance.choice([middle, chance.choice(words), chance.choice(numbers)]) + text[end:]
    return text


@pytest.mark.parametrize("name", ["First", "Backlash", "Oscillator", "CauerLowPassAnalog"])
def test_a_mutated_file_is_read_or_refused(name: str) -> None:
    text, chance = (FILES / f"{name}.mo").read_text(encoding="utf-8"), random.Random(name)  # noqa: S311 (no secret)
    with processor_time_limit(60), warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.NetworkWarning)
        for _ in range(150):
            with suppress(sw.ModelFileError):  # which is the only error that may come
                sw.read_modelica(mutated(text, chance)).network.check()
