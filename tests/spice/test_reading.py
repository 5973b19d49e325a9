"""Netlists as networks: each element by its own law, ngspice as the referee, and what is refused by its line."""

from __future__ import annotations

from pathlib import Path
from random import Random

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings

import shaftwork as sw
from tests.properties.examples import network_of
from tests.spice.ngspice import NEEDS_NGSPICE, run_deck
from tests.strategies import Network, networks

ACCURATE = ".options reltol=1e-6 abstol=1e-14 vntol=1e-9 chgtol=1e-18"


def voltages(text: str, node: str, times: object, **options: object) -> np.ndarray:
    circuit = sw.spice.read(text, **options)
    return circuit.simulate(t_eval=np.asarray(times), rtol=1e-10)[f"{node}.u"]


def error(text: str, steps: int = 8000) -> float:
    """How far the voltages of all nodes are from those of ngspice, in parts of the largest of each."""
    circuit = sw.spice.read(text)
    assert circuit.t_end is not None
    step, end = circuit.t_end / 1000, circuit.t_end
    start = " uic" if circuit.from_rest else ""
    rows = [row for row in text.splitlines() if not row.startswith((".tran", ".end "))]
    raw = run_deck("\n".join([*rows, ACCURATE, f".tran {step} {end} 0 {end / steps}{start}", ".end"]) + "\n")
    times = np.linspace(0.0, end, 102)[1:-1]
    motion = circuit.simulate(t_eval=times, rtol=1e-10, algebraic_loops="solve")
    worst = 0.0
    for node in circuit.network.nodes:
        if (name := f"v({node})") in raw:
            theirs = np.interp(times, raw["time"], raw[name])
            worst = max(worst, np.abs(motion[f"{node}.u"] - theirs).max() / max(np.abs(theirs).max(), 1e-9))
    return worst


# The trapezoidal rule of ngspice at 8000 steps, and 1e-6 to which it solves; where it is more, the reason is beside it.
CIRCUITS = {
    "resistors, capacitors and parameters": (
        """low pass
.param r=2k c={1m/r}
V1 in 0 SIN(0 1 50)
R1 in out {r}
C1 out 0 {c} ; half a microfarad
.tran 1m 60m
""",
        1e-5,
    ),
    "pulses, over a continued line": (
        """pulses
V1 1 0 PULSE(0 5 1m 0.1m 0.2m
+ 2m 4m)
R1 1 2 1k
C1 2 0 1u
.tran 0.1m 20m
""",
        1e-5,
    ),
    "straight pieces, exponentials and current sources": (
        """sources
V1 1 0 EXP(0 5 0.1m 0.2m 1m 0.3m)
R1 1 2 1k
C1 2 0 0.1u
I1 0 2 PWL(0 0 1m 1m 2m 0)
.tran 10u 3m
""",
        1e-5,
    ),
    "from rest with start values": (
        """swing
L1 1 0 10m IC=0.1
C1 1 0 10u IC=2
R1 1 0 1k
.tran 10u 10m uic
""",
        1e-4,  # a swing of three periods
    ),
    "start voltages of nodes": (
        """start
C1 1 2 1u
R1 1 0 1k
R2 2 0 1k
C2 2 0 1u
.ic V(1)=3 V(2)=1
.tran 10u 10m uic
""",
        1e-4,
    ),
    "voltage sources that follow voltages": (
        """inverting amplifier
V1 in 0 SIN(0 1 1k)
R1 in m 1k
R2 m out 10k
E1 out 0 0 m 1e5
C1 m 0 1p
.tran 10u 3m
""",
        1e-4,
    ),
    "current sources that follow voltages": (
        """gyrator: a capacitor is an inductor
V1 1 0 SIN(0 1 1k)
R1 1 2 100
G1 2 0 3 0 1m
G2 0 3 2 0 1m
C1 3 0 0.1u
R3 3 0 1meg
.tran 10u 3m
""",
        1e-4,
    ),
    "sources that follow currents": (
        """followers
V1 1 0 SIN(0 5 1k)
R1 1 2 10
Vs 2 3 0
R2 3 0 100
F1 0 5 Vs 3
R5 5 0 10
H1 6 0 Vs 7
R6 6 7 1k
C7 7 0 0.1u
F2 0 8 V1 2
R8 8 0 10
.tran 10u 3m
""",
        1e-5,
    ),
    "coupled inductors": (
        """transformer
V1 1 0 SIN(0 5 1k)
R1 1 2 10
L1 2 0 10m IC=0.1
L2 3 0 40m IC=-0.02
K1 L1 L2 0.9
R2 3 0 100
.tran 1u 3m uic
""",
        1e-4,
    ),
    "a line": (
        """charged line
V1 1 0 PULSE(5 0 2n 5n 5n 100n 200n)
R1 1 2 50
T1 2 0 3 0 Z0=75 TD=10n
R2 3 0 100
C2 3 0 100p
.tran 0.1n 100n
""",
        2e-3,  # ngspice interpolates the history of a line along straight lines
    ),
    "a diode": (
        """rectifier
V1 1 0 SIN(0 5 1k)
D1 1 2 dm
R1 2 0 1k
C1 2 0 1u
.model dm d(is=1e-14 n=1.2)
.tran 1u 3m
""",
        1e-4,
    ),
    "subcircuits with parameters of their own": (
        """filters
.subckt lp a b r=1k
.param c={1m/r}
R1 a b {r}
C1 b 0 {c}
.ends
.subckt two a b
X1 a c lp r=2k
X2 c b lp
.ends
V1 1 0 SIN(0 5 200)
X1 1 2 two
.tran 10u 10m
""",
        1e-5,
    ),
    "parameters that stand before those they read": (
        """order
.param r={2*s} unused = 2*s + 1
.param s={t*1k}
.param t=1
.subckt rc a b c=1u
.param tau={2*c*r}
R1 a b {tau/c}
C1 b 0 {c}
.ends
V1 in 0 SIN(0 1 50)
X1 in out rc c=2u
.tran 1m 60m
""",
        1e-5,
    ),
    "instances whose values read names of the subcircuit": (
        """scopes
.param c=9u r=500
.subckt rc a b r=1k c=1u
.param q=3u
R1 a b {r}
C1 b 0 {c+q}
.ends
.subckt two a b c=2u
X1 a b rc c={c} r={2*r+c*1e6}
.ends
V1 in 0 SIN(0 1 50)
X1 in out rc r={c*1e9} q=1u
X2 out far rc r={r} c={q}
X3 far end two
.tran 1m 60m
""",
        1e-4,
    ),
    "laws of time and of the own voltage": (
        """laws
.param smooth=0.1
B1 in 0 V={2*sin(300*time)*exp(-time)}
R1 in out 1k
C1 out 0 1u
B2 out 0 I = 1e-3*tanh(v(out)/{smooth})
B3 0 out I=-1e-4*v(0,out)*abs(v(0, out))
.tran 1m 60m
""",
        1e-5,
    ),
    "a resistance below zero": (
        """negative
V1 1 0 SIN(0 5 200)
R1 1 2 1k
R2 2 0 -3k
C1 2 0 1u
.tran 10u 10m
""",
        1e-4,
    ),
}


@NEEDS_NGSPICE
@pytest.mark.parametrize("name", CIRCUITS)
def test_a_netlist_moves_here_as_in_ngspice(name: str) -> None:
    text, tolerance = CIRCUITS[name]
    assert error(text) < tolerance


def test_a_switch_follows_its_voltage_with_hysteresis() -> None:
    text = """switch
V1 1 0 5
Vc c 0 PWL(0 0 1 2 2 0)
S1 1 2 c 0 sm
R1 2 0 1k
.model sm sw(vt=1 vh=0.2 ron=10 roff=1meg)
.tran 1m 2
"""
    times = [0.59, 0.61, 1.19, 1.21]  # it closes at 1.2 V and opens at 0.8 V
    closed, opened = 5 * 1000 / 1010, 5 * 1000 / 1001000
    np.testing.assert_allclose(voltages(text, "2", [*times, 1.59, 1.61]), [opened, *[closed] * 4, opened], rtol=1e-9)


@settings(max_examples=10, suppress_health_check=[HealthCheck.too_slow])
@given(networks(max_inertias=8))
def test_what_was_written_is_read_again_and_moves_alike(pieces: Network) -> None:
    """Without ngspice: a linear network, its deck, and the circuit that is read from that, each solved exactly."""
    net, times = network_of(pieces), np.linspace(0.0, 0.5, 6)
    again = sw.spice.read(net.to_spice(t_end=0.5))
    first, second = net.simulate(0.5, t_eval=times), again.simulate(t_eval=times)
    for node, domain in zip(net.graph().nodes, net.graph().domains, strict=True):
        ours = first[f"{node}.{domain.across.name}"]
        label = "".join(sign if sign.isalnum() else "_" for sign in node).lower()
        # two sets of states round differently: 1e-8 of the largest
        np.testing.assert_allclose(second[f"{label}.u"], ours, rtol=0, atol=1e-8 * max(np.abs(ours).max(), 1e-9))


def random_circuit(random: Random) -> str:
    """A ladder of resistors, a capacitor, perhaps an inductor, and sources that follow its voltages and currents."""
    count = random.randint(3, 6)
    rows = ["random", "V1 1 0 SIN(0 1 50)", "Vm m 0 0", "Rm 1 m 100"]
    for k in range(2, count + 1):
        rows += [f"R{k} {k} {random.randint(1, k - 1)} {random.choice([10, 33, 470])}", f"Rg{k} {k} 0 1k"]
    rows.append(f"C1 {count} 0 {random.choice([1, 10])}u")
    rows += [f"L1 {count} 2 {random.choice([1, 10])}m"] * random.randint(0, 1)
    for k in range(random.randint(1, 3)):
        to, over, at = random.randint(2, count), random.randint(0, count), random.randint(1, count)
        gain = random.choice([-0.5, 0.3, 0.8])
        rows += random.choice(
            [
                [f"E{k} x{k} 0 {at} {over} {gain}", f"Rx{k} x{k} {to} 150"],
                [f"G{k} {to} 0 {at} {over} {gain}m"],
                [f"F{k} {to} 0 Vm {gain}"],
                [f"H{k} x{k} 0 Vm {100 * gain}", f"Rx{k} x{k} {to} 150"],
            ]
        )
    return "\n".join([*rows, ".tran 20u 60m uic", ""])


@pytest.mark.slow
@NEEDS_NGSPICE
@pytest.mark.parametrize("seed", range(50))
def test_random_circuits_with_feedback_move_here_as_in_ngspice(seed: int) -> None:
    random = Random(seed)  # noqa: S311 (a seed, so that a failure can be repeated)
    assert error(random_circuit(random), 8000) < 1e-4  # the trapezoidal rule, of which small voltages show most


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1k", 1e3),
        ("2.2kOhm", 2.2e3),
        ("1meg", 1e6),
        ("1M", 1e-3),
        ("10MIL", 254e-6),
        ("3u", 3e-6),
        (".5n", 0.5e-9),
        ("1e3", 1e3),
        ("1e-3k", 1.0),
        ("5V", 5.0),
        ("{2*(3+1)}", 8.0),
        ("'2^3'", 8.0),
        ("{sqrt(4)*1k}", 2e3),
        ("{2*pi*60}", 120 * np.pi),
    ],
)
def test_numbers_have_suffixes_and_units(text: str, value: float) -> None:
    circuit = sw.spice.read(f"title\nR1 1 0 {text}\nV1 1 0 1\n")
    assert pytest.approx(value, rel=1e-15) == circuit.network.parts[0].R


def test_a_mil_is_a_milli_in_parameters_as_in_ngspice() -> None:
    """ngspice gives 0.02477 V at node 2: 25.4e-6 over 25.4e-6 + 1e-3."""
    circuit = sw.spice.read("t\n.param a=1mil\nV1 1 0 1\nR1 1 2 {a}\nR2 2 0 1mil\n.tran 1m 10m\n.end\n")
    values = {placed.part.name: placed.part for placed in circuit.network.netlist().placed}
    assert (values["R1"].R, values["R2"].R) == (1e-3, 25.4e-6)


def test_node_0_is_the_ground_and_names_of_nodes_have_no_case() -> None:
    circuit = sw.spice.read("title\nV1 IN GND 1\nR1 in Out 1\nR2 OUT 0 1\n")
    assert circuit.network.nodes == ("in", "ground", "out")


def test_without_uic_a_motion_begins_in_the_steady_state_whatever_ic_says() -> None:
    text = "title\nV1 1 0 5\nR1 1 2 1k\nR2 2 0 1k\nC1 2 0 1u IC=3\n.tran 1u 1m\n"
    np.testing.assert_allclose(voltages(text, "2", [0.0, 1e-3]), 2.5, rtol=1e-12)
    np.testing.assert_allclose(voltages(text.replace("1m\n", "1m uic\n"), "2", [0.0]), 3.0, rtol=1e-12)


def test_what_analyses_and_controls_say_is_left_out() -> None:
    text = (
        "title\nV1 1 0 DC 2 AC 1 90\nR1 1 0 1\n.ac dec 10 1 1k\n.control\nplot v(1)\n.endc\n.end\nQ1 behind the end\n"
    )
    circuit = sw.spice.read(text)
    assert [part.name for part in circuit.network.parts] == ["V1", "R1"]
    assert circuit.network.parts[0].u == 2.0
    assert circuit.t_end is None
    with pytest.raises(sw.ParameterError, match=r"no \.tran"):
        circuit.simulate()


def test_all_lines_that_are_not_understood_are_named_together() -> None:
    text = """title
V1 1 0 5
R1 1 2
Q1 1 2 3 transistor
.include other.lib
E1 3 0 POLY(2) 1 2
D1 1 0 zener
.model zener d(bv=5)
R2 1 2 a+
T1 1 2 3 0 Z0=50 TD=1n
"""
    with pytest.raises(sw.ModelFileError) as caught:
        sw.spice.read(text)
    message = str(caught.value)
    assert message.startswith("netlist: 7 lines are not understood:")
    for number in (3, 4, 5, 6, 8, 9, 10):
        assert f"line {number} '" in message
    assert "bv of a model of type d is not read. Known: is, n, rs" in message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("R1 1 0 1k\nV1 1 0 1\n", "the first line of SPICE is its title"),
        ("title\nX1 1 0 unknown\n", "there is no subcircuit 'unknown'"),
        ("title\n.subckt a 1\nR1 1 0 1\n", "the subcircuit does not end"),
        ("title\n.ends\n", "no subcircuit begins before it"),
        ("title\nX1 1 0 a m=5\n.subckt a 1 2\nR1 1 2 1\n.ends\n", "line 2 'X1 1 0 a m=5': M puts several"),
        ("title\nD1 1 0 d\nR1 1 0 1\n.model d d(level=200)\n", "level of a model of type d is not read"),
        ("title\n.subckt a 1 2\nX1 1 2 a\n.ends\nX1 1 0 a\n", "inside each other more than 20 times"),
        ("title\nF1 1 0 V9 2\nR1 1 0 1\n", "no voltage source 'V9'"),
        ("title\nL1 1 0 1\nR1 1 0 1\nK1 L1 L2 0.5\n", "two inductors"),
        ("title\nL1 1 0 1\nL2 1 0 1\nK1 L1 L2 2\n", "between 0 and 1"),
        ("title\nR1 1 2 1\nR2 2 1 1\n", "no element is at node 0"),
        ("", "it has no elements"),
        ("title\n.param f(x)=2\nR1 1 0 1\n", "line 2"),
        ("title\n.subckt a 1\nR1 1 0 1\n.ends\n.subckt A 1\nR1 1 0 2\n.ends\n", "line 2 defines this subcircuit, too"),
        ("title\nR1 1 0 1\n.model m d()\n.model M d(n=2)\n", "line 3 has this model, too"),
        ("title\nR1 1 0 {p}\n.param p={q}\n.param q={p}\n", "parameters p, q read each other"),
        ("title\nB1 1 0 V=2*v(2)\nR1 1 0 1\n", "of the voltage across the source"),
        ("title\nB1 1 0 5\nR1 1 0 1\n", "V=expression or I=expression"),
        ("title\nR1 1 0 {x}\n", "1 names have no value: x"),
        ("title\nR1 1 0 {1/0}\n", "cannot be read"),
        ("title\nR1 1 0 1e999\n", "line 2"),
        ("title\nL1 1 0 -1m\nR1 1 0 1\n", "line 2 'L1 1 0 -1m': L = -0.001 must be at least 0"),
        ("title\nV1 1 0 SIN(0)\n", "SIN has 1 values"),
        ("title\nV1 1 0 PWL(0 1 2)\n", "PWL takes pairs"),
        ("title\nC1 1 0 1u IC=1\n.ic v(1)=2\nR1 1 0 1\n.tran 1u 1m\n", "without uic"),
        ("title\n.tran 1\nR1 1 0 1\n", "written .tran step end"),
        (
            "title\nC1 1 0 1u IC=5\nT1 1 0 2 0 Z0=50 TD=1u\nR1 2 0 1\n.tran 1n 1u uic\n",
            "line 5 '.tran 1n 1u uic': it begins with charged capacitors",
        ),
        ("title\nS1 1 0 1 0 sm ON\n.model sm sw()\n", "is not read"),
    ],
)
def test_what_is_wrong_is_refused_with_its_line(text: str, words: str) -> None:
    with pytest.raises(sw.ModelFileError, match=words.replace("(", r"\(").replace(".", r"\.")):
        sw.spice.read(text)


def test_a_file_is_named_in_errors_and_missing_ones_are_told(tmp_path: Path) -> None:
    with pytest.raises(sw.ModelFileError, match=r"missing.cir' cannot be read: No such file"):
        sw.spice.read(tmp_path / "missing.cir")
    (tmp_path / "wrong.cir").write_text("title\nQ1 1 2 3 m\n")
    with pytest.raises(sw.ModelFileError, match=r"wrong\.cir: a line is not understood:\n  line 2 'Q1 1 2 3 m'"):
        sw.spice.read(tmp_path / "wrong.cir")


@pytest.mark.parametrize("text", ["rectifier.cir", "", "title\n.tran 1m 1\n.end\n"])
def test_a_text_without_elements_is_refused(text: str) -> None:
    """A path as a str would be the title of an empty circuit."""
    with pytest.raises(sw.ModelFileError, match=r"no elements.*pathlib\.Path"):
        sw.spice.read(text)


def test_diodes_may_be_ideal() -> None:
    text = "title\nV1 1 0 SIN(0 1 50)\nD1 1 2 m\nR1 2 0 1k\nC1 2 0 1u\n.tran 1m 5m\n"
    with pytest.raises(sw.ModelFileError, match=r"there is no \.model 'm'"):
        sw.spice.read(text)
    peak = voltages(text, "2", [5e-3], ideal_diodes=True)
    np.testing.assert_allclose(peak, 1.0, rtol=1e-9)


@pytest.mark.parametrize(
    ("source", "options", "words"),
    [
        (5, {}, "the text of a netlist"),
        ("title\n", {"dialect": "pspice"}, "'spice', 'lcapy' or None"),
        ("title\n", {"values": {"R1": "big"}}, "must be a number"),
    ],
)
def test_wrong_arguments_are_refused(source: object, options: dict[str, object], words: str) -> None:
    with pytest.raises(sw.ParameterError, match=words):
        sw.spice.read(source, **options)


def test_values_stand_in_for_names_and_win_over_parameters() -> None:
    text = "title\n.param r=1\nV1 1 0 1\nR1 1 2 {r}\nR2 2 0 {s}\n"
    circuit = sw.spice.read(text, {"R": 3.0, "s": 1.0})
    assert [part.R for part in circuit.network.parts if isinstance(part, sw.Resistor)] == [3.0, 1.0]


def test_lcapy_wires_join_nodes_and_elements_without_values_have_names() -> None:
    text = """
V 1 0 step 20; down
R 1 2; right=1.5, i=i_R
L 2 3 L1; right
C 3 0_1 {2*C0}; down
W 0 0_1; right
P1 3 0; down
"""
    with pytest.raises(sw.ModelFileError, match="3 names have no value: R, L1, C0"):
        sw.spice.read(text)
    circuit = sw.spice.read(text, {"R": 3.0, "L1": 1.0, "C0": 0.25})
    assert circuit.network.nodes == ("1", "ground", "2", "3")
    t = np.linspace(0.1, 3.0, 4)
    step = circuit.simulate(3.0, t_eval=t, rtol=1e-11)["3.u"]
    np.testing.assert_allclose(step, 20 * (1 + np.exp(-2 * t) - 2 * np.exp(-t)), rtol=1e-8)  # poles at -1 and -2


def test_lcapy_sources_deliver_at_their_first_node() -> None:
    """As lcapy does, and other than SPICE: a current of 2 A into 3 ohm, and one of 5 S times 2 V."""
    text = "I1 1 0 2; down\nR1 1 0 3; down\nV2 2 0 2; down\nG1 3 0 2 0 5; down\nR3 3 0 3; down\nR2 2 0 1; down\n"
    motion = sw.spice.read(text).simulate(1.0)
    assert motion["1.u"][-1] == pytest.approx(6.0)
    assert motion["3.u"][-1] == pytest.approx(30.0)


def test_lcapy_start_values_make_a_motion_from_rest() -> None:
    circuit = sw.spice.read("V1 1 0 5; down\nL1 1 2 2 3; right\nR1 2 0 3; down\n")
    times = np.linspace(0.0, 2.0, 5)
    motion = circuit.simulate(2.0, t_eval=times, rtol=1e-11)
    np.testing.assert_allclose(motion["2.u"], 5 + 4 * np.exp(-1.5 * times), rtol=1e-8)  # that of lcapy 1.26


def test_lcapy_laws_may_be_expressions_of_time() -> None:
    circuit = sw.spice.read("V1 1 0 {3*sin(2*t)*u(t)}; down\nR1 1 0 1; down\nTF1 2 0 1 0 4; right\nR2 2 0 1; down\n")
    np.testing.assert_allclose(circuit.simulate(1.0)["2.u"][-1], 12 * np.sin(2.0), rtol=1e-9)


@pytest.mark.parametrize(
    ("source", "start", "of_lcapy"),
    [
        ("ac 3 0.4 2", 1.14832985063, [1.16063279656, -1.23643254864]),
        ("{3*cos(2*t) + 5*u(t) + 1}", 1.47435897436, [3.84271966412, 2.59869985105]),
        ("{exp(-t)}", 0.0, [0.28560218730, 0.16761102317]),
        ("dc 3", 2.0, [2.0, 2.0]),
    ],
)
def test_what_swings_in_lcapy_has_always_swung_and_all_else_begins_at_zero(
    source: str, start: float, of_lcapy: list[float]
) -> None:
    """The motion of lcapy 1.26, which superposes direct voltages, steady waves and what begins at time zero."""
    circuit = sw.spice.read(
        f"V1 1 0 {source}; down\nR1 1 2 1; right\nC1 2 0 1; down\nL1 2 3 0.5; right\nR2 3 0 2; down\n"
    )
    motion = circuit.simulate(2.0, t_eval=[0.0, 0.5, 2.0], rtol=1e-10)
    np.testing.assert_allclose(motion["2.u"], [start, *of_lcapy], rtol=1e-7, atol=1e-12)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("U1 buffer; right", "type U"),
        (",; right", "line 2 ','"),
        ("SW 1 2 0 spdt; right", "no and nc"),
        ("V1 1 0 s 5; down", "not understood"),
        ("E1 1 0 fdopamp 2 3 4 A; right", "plain opamps"),
        ("V1 1 0 {delta(t)}; down", "cannot be read"),
    ],
)
def test_what_lcapy_has_besides_is_refused_with_its_line(line: str, words: str) -> None:
    with pytest.raises(sw.ModelFileError, match=words):
        sw.spice.read(f"R1 1 0 1; right\n{line}\n", {"A": 1.0})


def test_a_pulse_that_begins_after_the_end_is_low_until_then() -> None:
    circuit = sw.spice.read("late\nV1 a 0 PULSE(2 5 9 1m 1m 1m 10m)\nR1 a 0 1\nC1 a 0 1u\n.tran 1m 0.1\n.end\n")
    motion = circuit.network.simulate(0.1, t_eval=3)
    assert list(motion["V1.u"]) == [2.0, 2.0, 2.0]


def test_a_pulse_without_a_width_stays_where_no_end_is_told() -> None:
    """SPICE takes the end of the analysis for the width; without one the pulse has no end."""
    circuit = sw.spice.read("t\nV1 a 0 PULSE(0 5 1m 1u 1u)\nR1 a b 1k\nC1 b 0 1u\n.end\n")
    after = circuit.simulate(0.02, t_eval=[0.02])["b.u"][0]
    assert after == pytest.approx(5.0 * (1 - np.exp(-19.0)), rel=1e-5)  # the rise of 1 us shifts it by 5e-7
    with pytest.raises(sw.ModelFileError, match="a period and no width"):
        sw.spice.read("t\nV1 a 0 PULSE(0 5 1m 1u 1u 0 5m)\nR1 a 0 1k\n.end\n")


@pytest.mark.parametrize("law", ["EXP(0 5 1 1m 2 1m)", "SIN(0 5 50 1 1k)"])
def test_a_law_that_begins_after_a_thousand_of_its_time_constants_is_finite(law: str) -> None:
    """exp(t_begin / rise) = exp(1000) is no float."""
    source = sw.spice.read(f"t\nV1 a 0 {law}\nR1 a 0 1\n.tran 1m 1.5\n.end\n").simulate(t_eval=[0.9, 1.002])["a.u"]
    expected = 5 * (1 - np.exp(-2.0)) if law.startswith("EXP") else 5 * np.exp(-2.0) * np.sin(2 * np.pi * 50 * 0.002)
    np.testing.assert_allclose(source, [0.0, expected], rtol=1e-9, atol=1e-12)


def test_values_that_are_no_mapping_are_refused() -> None:
    with pytest.raises(sw.ParameterError, match="must map names to numbers"):
        sw.spice.read("t\nR1 a 0 {x}\n.end\n", [1.0])  # type: ignore[arg-type]


def test_an_instance_that_names_no_subcircuit_is_refused_with_its_line() -> None:
    with pytest.raises(sw.ModelFileError, match="line 2 'X1 r=2': it names no subcircuit"):
        sw.spice.read("t\nX1 r=2\n.end\n")
