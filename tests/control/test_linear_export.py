"""Linear models in python-control, scipy and CSV: the same numbers under names that lead back."""

from __future__ import annotations

import csv
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from hypothesis import given
from scipy import signal

import shaftwork as sw
from tests.properties.examples import compiled, share_of_examples
from tests.strategies import Network, networks

F = np.array([0.03, 0.7, 5.0])


def two_masses(drive: sw.Component | None = None) -> sw.Network:
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=0.0) if drive is None else drive, "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=1e4, d=40.0), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    return net


@given(networks(max_inertias=10))
@share_of_examples()
def test_the_bode_diagram_of_python_control_is_that_of_the_network(pieces: Network) -> None:
    """Within 1e-12 of the largest amplitude; beside a pole both lose digits, by the condition of s - A."""
    linear = compiled(pieces).linearize()
    if linear.D1.any():
        with pytest.raises(sw.SimulationError, match="depends on the rate of the input"):
            linear.to_control()
        return
    system, s = linear.to_control(), 2j * np.pi * F
    ours = [[linear.frequency_response(v, y, F).values for v in linear.inputs] for y in linear.outputs]
    wanted = np.array(ours).reshape(len(linear.outputs), len(linear.inputs), len(F))
    condition = max(np.linalg.cond(p * np.eye(len(linear.states)) - linear.A) for p in s)
    assert [name.replace(":", ".") for name in system.input_labels] == [*linear.inputs]
    np.testing.assert_allclose(
        system(s, squeeze=False), wanted, atol=max(1e-12, 1e-15 * condition) * np.abs(wanted).max()
    )


def test_the_frequency_response_is_the_same_in_all_libraries() -> None:
    linear = two_masses().compile().linearize(outputs=("J2.omega", "shaft.tau"))
    system, plain = linear.to_control(), linear.to_scipy()
    assert isinstance(plain, signal.StateSpace)
    w, ours = 2 * np.pi * F, linear.frequency_response("motor.tau", "shaft.tau", F).values
    by_name = system["shaft:tau", "motor:tau"]
    np.testing.assert_allclose(by_name(1j * w), ours, rtol=1e-12)
    values = [
        plain.C[1] @ np.linalg.solve(1j * each * np.eye(3) - plain.A, plain.B[:, 0]) + plain.D[1, 0] for each in w
    ]
    np.testing.assert_allclose(values, ours, rtol=1e-12)


def test_names_lead_there_and_back() -> None:
    system = two_masses().compile().linearize(outputs=("J2.omega", "shaft.tau")).to_control()
    assert system.name == "two masses"
    assert system.input_labels == ["motor:tau"]
    assert system.output_labels == ["J2:omega", "shaft:tau"]
    assert system.state_labels == ["J1:omega", "J2:omega", "shaft:tau_c"]
    assert system.isctime(strict=True)


def test_brackets_become_parentheses_and_names_that_meet_are_refused() -> None:
    net = sw.Network("brackets [1.0]")
    net.add(sw.TorqueSource("motor", tau=0.0), "a")
    net.add(sw.Inertia("J[1]", J=1.0), "a")
    net.add(sw.Spring("s", c=1.0), "a", "b")
    net.add(sw.Inertia("K", J=1.0), "b")
    system = net.compile().linearize().to_control()
    assert system.state_labels[0] == "J(1):omega"
    assert system.name == "brackets (1:0)"
    net.remove("K")
    net.add(sw.Inertia("J(1)", J=1.0), "b")
    with pytest.raises(sw.ParameterError, match=r"'J\[1\].omega' and 'J\(1\).omega' would both be 'J\(1\):omega'"):
        net.compile().linearize().to_control()


def speed_drive() -> Any:
    """A prescribed speed on an inertia: its torque follows the rate of the speed."""
    drive = sw.SpeedSource("drive", omega=0.0)
    return two_masses(drive).compile().linearize(outputs=("drive.tau", "J2.omega"))


@pytest.mark.parametrize("method", ["to_control", "to_scipy"])
def test_an_output_that_follows_the_rate_of_an_input_is_refused_by_name(method: str) -> None:
    with pytest.raises(
        sw.SimulationError, match=r"'drive.tau' of 'two masses' depends on the rate of .* 'drive.omega'"
    ):
        getattr(speed_drive(), method)()


def test_what_follows_no_rate_is_there_beside_a_prescribed_speed() -> None:
    """J1 turns at the speed that is prescribed, so that the train is a base that moves under one oscillator."""
    model = two_masses(sw.SpeedSource("drive", omega=0.0)).compile()
    system, s = model.linearize(outputs=("J2.omega",)).to_control(), 2j * np.pi * F
    np.testing.assert_allclose(system(s), (40 * s + 1e4) / (3 * s**2 + 40 * s + 1e4), rtol=1e-12)


def test_a_network_without_states_is_a_gain() -> None:
    net = sw.Network("gain")
    net.add(sw.TorqueSource("motor", tau=0.0), "a")
    net.add(sw.Damper("brake", d=4.0), "a")
    linear = net.compile().linearize(outputs=("brake.omega",))
    assert linear.to_control()(1j) == pytest.approx(0.25, rel=1e-15)
    np.testing.assert_array_equal(linear.to_scipy().D, [[0.25]])


def table(path: Path) -> tuple[list[str], list[str], np.ndarray]:
    """Columns, rows and numbers of a table with names."""
    (_, *columns), *lines = csv.reader(path.read_text(encoding="utf-8").splitlines())
    return columns, [line[0] for line in lines], np.array([line[1:] for line in lines], dtype=float)


def test_one_table_has_all_matrices_to_the_last_bit(tmp_path: Path) -> None:
    linear = two_masses().compile().linearize(outputs=("J2.omega", "shaft.tau"))
    linear.to_csv(tmp_path / "linear.csv")
    columns, rows, numbers = table(tmp_path / "linear.csv")
    assert columns == ["J1.omega", "J2.omega", "shaft.tau_c", "motor.tau"]
    assert rows == ["der(J1.omega)", "der(J2.omega)", "der(shaft.tau_c)", "J2.omega", "shaft.tau"]
    np.testing.assert_array_equal(numbers, np.block([[linear.A, linear.B], [linear.C, linear.D]]))


def test_a_folder_has_a_table_for_each_matrix_and_what_follows_rates(tmp_path: Path) -> None:
    linear = speed_drive()
    linear.to_csv(tmp_path / "linear")
    linear.to_csv(tmp_path / "linear")  # again, over those that are there
    assert sorted(path.name for path in (tmp_path / "linear").iterdir()) == [
        "A.csv",
        "B.csv",
        "C.csv",
        "D.csv",
        "D1.csv",
    ]
    columns, rows, numbers = table(tmp_path / "linear" / "D1.csv")
    assert (columns, rows) == (["der(drive.omega)"], ["drive.tau", "J2.omega"])
    np.testing.assert_array_equal(numbers, linear.D1)
    linear.to_csv(tmp_path / "all.csv")
    assert table(tmp_path / "all.csv")[0][-2:] == ["drive.omega", "der(drive.omega)"]


def test_a_place_where_nothing_can_be_written_is_refused(tmp_path: Path) -> None:
    linear = two_masses().compile().linearize()
    with pytest.raises(sw.ParameterError, match="There is no folder"):
        linear.to_csv(tmp_path / "nowhere" / "linear.csv")
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(sw.ParameterError, match="is a file"):
        linear.to_csv(tmp_path / "file")


def test_without_python_control_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(sw.MissingExtraError, match=r"shaftwork\[control\]"):
        two_masses().compile().linearize().to_control()


def test_linear_models_modes_and_transfer_functions_travel_after_they_were_used() -> None:
    linear, equations = two_masses().compile().linearize(outputs=("J2.omega",)), two_masses().equations()
    modes, transfer = linear.modes(), equations.transfer_function("motor.tau", "J2.omega")
    shape, value, text = modes.shapes["shaft.tau"], transfer(2j), transfer.latex()
    equations.latex()
    linear_2, modes_2, transfer_2 = pickle.loads(pickle.dumps((linear, modes, transfer)))  # noqa: S301
    np.testing.assert_array_equal(linear_2.A, linear.A)
    np.testing.assert_array_equal(modes_2.shapes["shaft.tau"], shape)
    assert (transfer_2(2j), transfer_2.latex()) == (value, text)


def test_a_transfer_function_is_read_in_another_process(tmp_path: Path) -> None:
    transfer = two_masses().equations().transfer_function("motor.tau", "J2.omega")
    transfer.latex()
    (tmp_path / "it").write_bytes(pickle.dumps(transfer))
    script = "import pickle, sys; print(pickle.load(open(sys.argv[1], 'rb'))(2j).item())"
    printed = subprocess.run(
        [sys.executable, "-c", script, tmp_path / "it"], capture_output=True, text=True, check=True
    )
    assert complex(printed.stdout) == transfer(2j)


def test_a_controller_of_python_control_closes_the_loop_by_names() -> None:
    """`interconnect` joins signals of equal names: here the loop of a proportional controller of the speed."""
    plant = two_masses().compile().linearize(outputs=("J2.omega",)).to_control()
    gain = control.ss([], [], [], [[-3.0]], inputs=["J2:omega"], outputs=["motor:tau"], name="gain")
    loop = control.interconnect([plant, gain], inputs=["motor:tau"], outputs=["J2:omega"])
    s = 2j * np.pi * F
    np.testing.assert_allclose(loop(s), plant(s) / (1 + 3 * plant(s)), rtol=1e-9)
