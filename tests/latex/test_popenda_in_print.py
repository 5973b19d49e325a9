"""Popenda 2019: his equations as he prints them, typed by hand here, against the rows and the motion of a network."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.linalg import expm
from sympy import Derivative, Expr, Function, Symbol, simplify, sqrt

import shaftwork as sw
from shaftwork.components.laws import t
from shaftwork.components.shaft_models import ShaftModel
from shaftwork.core.errors import CompileError, ParameterError
from shaftwork.equations.fields import X
from shaftwork.equations.kirchhoff import Row
from shaftwork.equations.notations import NOTATIONS
from shaftwork.scenes import SCENES

STEEL = {"length": 1.0, "diameter": 0.02, "density": 7900.0, "shear_modulus": 77.5e9}
I_P = np.pi * 0.02**4 / 32
TORQUE, J_E, J_M = 12.7, 0.025, 0.11


def symbol(name: str) -> Symbol:
    return Symbol(name, real=True)


def his_drive(model: ShaftModel, damping: float = 0.3, bearings: float = 0.02) -> sw.Network:
    """Motor, shaft and rotating mass, with bearings at both ends."""
    net = sw.Network("Popenda")
    net.add(sw.TorqueSource("motor", tau=TORQUE), "motor end")
    net.add(sw.Inertia("Je", J=J_E), "motor end")
    net.add(sw.Damper("D1", d=bearings), "motor end")
    net.add(sw.Shaft("line", **STEEL, damping=damping, model=model), "motor end", "load end")
    net.add(sw.Inertia("Jm", J=J_M), "load end")
    net.add(sw.Damper("Dm", d=bearings), "load end")
    return net


def chain(m: int, stiffness: float = 900.0, damping: float = 0.1, bearings: float = 0.02) -> sw.Network:
    """His structure of m elements, part by part (his figure 1)."""
    net = sw.Network("his lumped shaft")
    net.add(sw.TorqueSource("M1", tau=TORQUE), "1")
    for k in range(1, m + 1):
        net.add(sw.Inertia(f"J{k}", J=0.01 * k), str(k))
    net.add(sw.Damper("D1", d=bearings), "1")
    net.add(sw.Damper("Dm", d=bearings), str(m))
    for k in range(1, m):
        net.add(sw.Spring(f"c{k}", c=stiffness, d=damping), str(k), str(k + 1))
    net.add(sw.TorqueSource("Mm", tau=-2.0), str(m))
    return net


@pytest.mark.parametrize("m", [3, 4, 9])
def test_the_rows_of_a_lumped_shaft_are_his_1_to_4(m: int) -> None:
    equations = chain(m).equations()
    speed = [symbol(f"J{k}.omega") for k in range(m + 1)]
    torque = [symbol(f"c{k}.tau_c") for k in range(m)]
    inertia = [symbol(f"J{k}.J") for k in range(m + 1)]
    damping, stiffness = ([symbol(f"c{k}.{name}") for k in range(m)] for name in ("d", "c"))
    rate = [symbol(f"der(J{k}.omega)") for k in range(m + 1)]

    def through(k: int) -> Expr:
        """M_c,k,k+1 + D_k,k+1 (omega_k - omega_k+1)."""
        return torque[k] + damping[k] * (speed[k] - speed[k + 1])

    first = symbol("M1.tau") - symbol("D1.d") * speed[1] - inertia[1] * rate[1] - through(1)
    inner = [through(k - 1) - through(k) - inertia[k] * rate[k] for k in range(2, m)]
    last = through(m - 1) - inertia[m] * rate[m] - symbol("Dm.d") * speed[m] + symbol("Mm.tau")
    known = {row.left: row.right for row in (*equations.laws, *equations.loops)}

    def written_out(row: Row) -> Expr:
        expression = row.expression
        for _ in range(3):  # a torque by its law, the speed in that by its loop
            expression = expression.xreplace(known)
        return expression

    for row, his in zip(equations.nodes, [first, *inner, last], strict=True):
        assert (written_out(row) - his).expand() == 0
    susceptibility = [1 / c for c in stiffness]
    rates = {row.left: row.right for row in equations.states}
    for k in range(1, m):
        his = speed[k] - speed[k + 1] - susceptibility[k] * rates[symbol(f"der(c{k}.tau_c)")]
        assert his.expand() == 0


def test_a_lumped_shaft_in_his_letters() -> None:
    text = chain(9).equations().latex(form="kirchhoff", notation="popenda")
    assert r"J_{1} \, \frac{d \omega_{1}}{d t} &= M_{1} - M_{\mathrm{D},1} - M_{\mathrm{c},1}" in text
    text = text.replace(r"\mathrm{c},", "")
    assert r"S_{c,k} \, \frac{d M_{c,k}}{d t} &= \Delta \omega_{k} \qquad \text{for } k = 1, \dots, 8" in text
    assert r"D_{k} \, \Delta \omega_{k}" in text


def transcribed(m: int, damping: float, bearings: float) -> tuple[np.ndarray, np.ndarray]:
    """(20)-(23) by hand, in the order omega_0, ..., omega_m, M_1, ..., M_{m-1}; with M_0 = M_1 and M_m = M_{m-1}."""
    J, S_c, dx = 7900.0 * I_P, 1 / (77.5e9 * I_P), 1.0 / m
    matrix, drive = np.zeros((2 * m, 2 * m)), np.zeros(2 * m)

    def M(k: int) -> int:
        return m + min(max(k, 1), m - 1)

    for k in range(1, m):
        for neighbour, sign in ((k + 1, 1.0), (k - 1, -1.0)):
            matrix[M(k), neighbour] -= sign / (2 * S_c * dx)  # (20)
            matrix[k, M(neighbour)] -= sign / (2 * J * dx)  # (21)
        for place, weight in ((k + 1, 1.0), (k, -2.0), (k - 1, 1.0)):
            matrix[M(k), M(place)] += damping / J * weight / (2 * dx**2)
    matrix[0, 0], matrix[0, M(1)], drive[0] = -bearings / J_E, -1 / J_E, TORQUE / J_E  # (22)
    matrix[m, m], matrix[m, M(m - 1)] = -bearings / J_M, 1 / J_M  # (23)
    return matrix, drive


@pytest.mark.parametrize("m", [3, 4, 7, 20])
@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_the_paper_form_is_the_motion_of_his_20_to_23(m: int, damping: float) -> None:
    matrix, drive = transcribed(m, damping, 0.02)
    sol = his_drive(sw.CentralDifference(m, form="paper"), damping).simulate(0.02, t_eval=[0.0, 0.004, 0.02])
    for row, time in enumerate(sol.t):
        whole = np.zeros((2 * m + 1, 2 * m + 1))
        whole[:-1, :-1], whole[:-1, -1] = matrix * time, drive * time
        state = expm(whole)[:-1, -1]
        # 1e-9 of the largest: what both linear solutions leave of stiff modes
        assert sol["line.omega"][row] == pytest.approx(state[: m + 1], rel=1e-9, abs=1e-9)
        assert sol["line.tau"][row, 1:-1] == pytest.approx(state[m + 1 :][: m - 1], rel=1e-9, abs=1e-8)
        assert sol["line.tau_a"][row] == pytest.approx(state[m + 1], rel=1e-9, abs=1e-8)
        assert sol["line.tau_b"][row] == pytest.approx(state[-1], rel=1e-9, abs=1e-8)
    assert sol.energy.residual < 1e-9


@pytest.mark.parametrize("m", [3, 8, 11])
def test_the_rows_of_the_paper_form_are_his_20_to_23(m: int) -> None:
    equations = his_drive(sw.CentralDifference(m, form="paper")).equations()
    J, C, dx, D = (symbol(f"line.{n}") for n in ("line_inertia", "line_stiffness", "interval", "damping"))
    S_c = 1 / C
    speed = [symbol("Je.omega"), *(symbol(f"line.omega_{k}") for k in range(1, m)), symbol("Jm.omega")]
    torque = [symbol(f"line.tau_{min(max(k, 1), m - 1)}") for k in range(m + 1)]
    his = {"Je.omega": (symbol("motor.tau") - symbol("D1.d") * speed[0] - torque[1]) / symbol("Je.J")}
    for k in range(1, m):
        bend = (torque[k + 1] - 2 * torque[k] + torque[k - 1]) / (2 * dx**2)
        his[f"line.tau_{k}"] = -(speed[k + 1] - speed[k - 1]) / (2 * S_c * dx) + D / J * bend
        his[f"line.omega_{k}"] = -(torque[k + 1] - torque[k - 1]) / (2 * J * dx)
    his["Jm.omega"] = (torque[m - 1] - symbol("Dm.d") * speed[m]) / symbol("Jm.J")
    assert {row.name for row in equations.states} == set(his)
    for row in equations.states:
        assert (row.rate - his[row.name]).expand() == 0, row.name


def test_the_general_rows_in_his_letters() -> None:
    text = his_drive(sw.CentralDifference(10, form="paper")).equations().latex(form="state", notation="popenda")
    line = r"\mathrm{line}"
    assert (
        rf"\frac{{d \omega_{{{line},k}}}}{{d t}} &= \frac{{1}}{{2 \, J'_{{{line}}} \, \Delta x_{{{line}}}}} \left( "
        rf"M_{{{line},k-1}} - M_{{{line},k+1}} \right) \qquad \text{{for }} k = 2, \dots, 8"
    ) in text
    assert (
        rf"\frac{{d M_{{{line},k}}}}{{d t}} &= \frac{{1}}{{2 \, S'_{{c,{line}}} \, \Delta x_{{{line}}}}} \biggl[ "
        rf"\omega_{{{line},k-1}} - \omega_{{{line},k+1}} \biggr] + \frac{{D'_{{{line}}}}}{{2 \, J'_{{{line}}} \, "
        rf"\Delta x_{{{line}}}^{{2}}}} \biggl[ M_{{{line},k-1}}"
    ) in text
    assert rf"S'_{{c,{line}}} &= \frac{{1}}{{G_{{{line}}} \, I_{{p,{line}}}}}" in text


@pytest.mark.parametrize("order", [10, 20, 40])
def test_the_paper_form_converges(order: int) -> None:
    """To the exact first frequency, by the first order: what is missing is half a cell of inertia at each end."""
    exact, *found = (
        min(f for f in his_drive(model, 0.0, 0.0).modes(count=4).frequencies if f > 1.0)
        for model in (sw.Wave(), *(sw.CentralDifference(m, form="paper") for m in (order, 2 * order)))
    )
    errors = [abs(frequency / exact - 1) for frequency in found]
    assert errors[0] < 0.05 / order
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("model", [sw.Lumped(4), sw.Wave(), sw.CentralDifference(6, form="paper")], ids=repr)
def test_the_shaft_before_it_is_divided_is_his_8_to_15(model: ShaftModel) -> None:
    M, M_c, omega = (Function(f"line.{name}", real=True)(X, t) for name in ("tau", "tau_c", "omega"))
    J, C, D, v = (symbol(f"line.{name}") for name in ("line_inertia", "line_stiffness", "damping", "v"))
    S_c = 1 / C
    lossless = [
        (-Derivative(M, X), J * Derivative(omega, t)),  # (8), (13)
        (-Derivative(omega, X), S_c * Derivative(M, t)),  # (13)
        # (14) and (15), which he prints with a minus sign on the left
        *((Derivative(f, (X, 2)), J * S_c * Derivative(f, (t, 2))) for f in (M, omega)),
        *((Derivative(f, (X, 2)), Derivative(f, (t, 2)) / v**2) for f in (M, omega)),
    ]
    damped = [
        (-Derivative(M, X), J * Derivative(omega, t)),  # (8)
        (-Derivative(omega, X), S_c * Derivative(M_c, t)),  # (9)
        (M_c, M + D * Derivative(omega, X)),  # (10)
        (-Derivative(M, (X, 2)) / J, Derivative(omega, X, t)),  # (11)
        (-Derivative(omega, X), S_c * Derivative(M, t) - S_c * D / J * Derivative(M, (X, 2))),  # (12)
    ]
    cases = [(0.0, lossless), *([] if isinstance(model, sw.Wave) else [(0.3, damped)])]
    for damping, his in cases:
        (field,) = his_drive(model, damping).equations().fields
        for row, (left, right) in zip(field.rows, his, strict=True):
            assert simplify(row.lhs - left) == 0
            assert simplify(row.rhs - right) == 0
    assert simplify(v - sqrt(C / J)).xreplace(field.definitions) is not None


def test_waves_of_the_printed_speed_solve_the_lossless_rows() -> None:
    """(14) and (15) with the sign that waves have: any f(x - v t) solves them, and with his sign none does."""
    (field,) = his_drive(sw.Wave(), 0.0).equations().fields
    wave = Function("f", real=True)(X - symbol("line.v") * t)
    left, right = (side.subs(field.torque, wave).doit() for side in field.rows[4].args)
    assert simplify(left - right) == 0
    assert simplify(left + right) != 0


def test_the_ends_see_what_the_other_parts_give() -> None:
    (field,) = his_drive(sw.CentralDifference(6, form="paper")).equations().fields
    first, torque_a, _, torque_b = field.boundary
    assert first.rhs == symbol("Je.omega")
    inertia = symbol("Je.J") * symbol("der(Je.omega)")
    assert torque_a.rhs - (symbol("motor.tau") - symbol("D1.tau") - inertia) == 0
    assert torque_b.rhs - (symbol("Jm.J") * symbol("der(Jm.omega)") + symbol("Dm.tau")) == 0


def test_friction_along_the_shaft_stands_in_the_field() -> None:
    net = sw.Network("friction")
    net.add(sw.Shaft("line", **STEEL, damping=0.3, friction=0.2, model=sw.Lumped(4)), "a", "b")
    net.add(sw.Inertia("J", J=0.1), "a")
    (field,) = net.equations().fields
    kinetic, _, _, bent, last = field.rows
    friction = symbol("line.friction")
    assert (kinetic.rhs - symbol("line.line_inertia") * field.speed.diff(t) - friction * field.speed).expand() == 0
    # (11) is (8) derived by x, and (12) follows from it
    assert (bent.lhs - (kinetic.lhs - friction * field.speed).diff(X) / symbol("line.line_inertia")).expand() == 0
    assert last.has(friction)


def test_a_network_without_a_shaft_has_no_field() -> None:
    with pytest.raises(CompileError, match="has no Shaft"):
        chain(3).equations().latex(form="field")


@pytest.mark.parametrize("scene", ["crane", "bldc-shaft", "excavator"])
def test_scenes_print_in_every_notation(scene: str) -> None:
    net = SCENES[scene].build()
    equations = net.equations(phase=net.start_phase())
    texts = {equations.latex(form="state", notation=name) for name in (None, *NOTATIONS)}
    assert len(texts) == 1 + len(NOTATIONS)


def test_susceptibilities_have_their_values_and_units() -> None:
    text = chain(3).equations().document(notation="popenda").replace(r"\mathrm{c},", "")
    assert rf"$S_{{c,1}}$ & torsional susceptibility & c1 & ${1 / 900:.6g}$ & $\mathrm{{rad/(N\,m)}}$" in text
    numbers = chain(3).equations().latex(form="state", values=True, notation="popenda").replace(r"\mathrm{c},", "")
    assert r"\frac{d M_{c,1}}{d t} &= 900 \left( \omega_{1} - \omega_{2} \right)" in numbers


def test_a_notation_of_ones_own() -> None:
    own = sw.Notation({"tau": "Q"}, {("c", "N*m/rad"): "k"}, rate=r"\partial_t {}")
    text = chain(3).equations().latex(form="state", notation=own).replace(r"\mathrm{c},", "")
    assert r"\partial_t Q_{c,1} &= k_{1} \left( \omega_{1} - \omega_{2} \right)" in text


def test_marinkovic_has_rates_of_angles_for_speeds() -> None:
    text = chain(3).equations().latex(form="state", notation="marinkovic")
    assert r"\ddot{\varphi}_{1} &= \frac{1}{J_{1}} \left[ T_{1}" in text


@pytest.mark.parametrize(
    ("notation", "message"),
    [("popend", "no notation 'popend'"), (3, "no notation 3"), ({}, "no notation {}")],
)
def test_what_is_no_notation_is_refused(notation: Any, message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        chain(3).equations().latex(notation=notation)


def test_a_notation_names_quantities_that_are_there() -> None:
    with pytest.raises(ParameterError, match="no quantity 'torque'"):
        sw.Notation({"torque": "M"})
    for rate in ("d/dt", "{0}{1}", r"\dot{x}"):
        with pytest.raises(ParameterError, match="has no"):
            sw.Notation(rate=rate)


@pytest.mark.parametrize("model", [sw.Wave(), sw.Lumped(3), sw.CentralDifference(4), sw.Spectral(4)], ids=repr)
def test_a_clamped_end_has_a_speed_and_no_torque(model: ShaftModel) -> None:
    net = sw.Network("clamped")
    net.add(sw.Inertia("J", J=0.1), "a")
    net.add(sw.Shaft("line", **STEEL, model=model), "a", "ground")
    net.add(sw.Spring("c", c=3.0), "a", "z")
    net.add(sw.Inertia("J2", J=0.2), "z")
    equations = net.equations()
    (field,) = equations.fields
    assert [str(row.lhs) for row in field.boundary] == [
        "line.omega(0, t)",
        "line.tau(0, t)",
        "line.omega(line.length, t)",
    ]
    assert field.boundary[-1].rhs == 0
    assert r"\omega_{\mathrm{line}}(L_{\mathrm{line}}, t) &= 0" in equations.latex(form="field")
    assert equations.document()


def test_the_end_of_a_shaft_sees_the_torque_along_the_next() -> None:
    net = sw.Network("stepped")
    net.add(sw.Inertia("J", J=0.1), "a")
    net.add(sw.Shaft("p", **STEEL, model=sw.Lumped(4)), "a", "b")
    net.add(sw.Shaft("q", **STEEL, model=sw.Spectral(4)), "b", "c")
    first, second = net.equations().fields
    assert first.boundary[3].rhs == second.torque.subs(X, 0)
    assert second.boundary[1].rhs == first.torque.subs(X, first.symbol("length"))
    assert second.boundary[3].rhs == 0  # a free end
    text = net.equations().latex(form="field", notation="popenda")
    assert r"M_{\mathrm{p}}(L_{\mathrm{p}}, t) &= M_{\mathrm{q}}(0, t)" in text


def test_a_transfer_function_has_the_letters_of_its_equations() -> None:
    text = chain(2).equations().written_as("popenda").transfer_function("M1.tau", "J2.omega").latex()
    assert "S_{c," in text
    assert "c1.c" not in text


def test_letters_of_a_notation_may_have_subscripts() -> None:
    text = chain(3).equations().latex(form="state", notation=sw.Notation({"tau": "M_t"}))
    assert r"M_{t,c," in text


@sw.component
class Follower(sw.Component):
    """A node that turns k times as fast as another one.

    Law: omega_c = k omega_a.
    """

    k: float = sw.parameter("1", "ratio")
    role: ClassVar[Any] = "source"
    ports: ClassVar = (sw.Port("a"), sw.Port("c"))

    def branches(self, p: Any) -> Iterator[Any]:
        yield sw.AcrossLaw(p.k * sw.across_of("a"), ("c", None), "w_c")


def test_a_letter_that_stands_in_print_has_its_law_there() -> None:
    """Beside a spring the sum itself is printed, beside a damper its letter."""
    for part, letter in ((sw.Damper("d1", d=0.3), True), (sw.Spring("c1", c=0.3), False)):
        net = sw.Network("follower")
        net.add(sw.Inertia("J1", J=1.0), "a")
        net.add(Follower("f1", k=2.0), "a", "c")
        net.add(part, "c", "a")
        text = net.equations().latex(form="state")
        assert (r"\omega_{w,c,1} &= k_{1} \, \omega_{1}" in text) is letter
        assert (r"\omega_{w,c" in text) is letter
