from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import eigh_tridiagonal

from shaftwork.core.errors import ParameterError, SimulationError
from tests.reference.exact_shafts.exact_motion import JunctionTorque, LineMotion, common_step, motion
from tests.reference.exact_shafts.exact_response import laplace_response
from tests.reference.exact_shafts.line import Array, End, Section, SectionLine
from tests.reference.line_modes import modes

SHAFT = Section.of_geometry(1.0, 0.02)
POPENDA = SectionLine((SHAFT,), (0.025, 0.11))
STEPPED = SectionLine(
    (Section.of_geometry(0.5, 0.03), Section.of_geometry(1.0, 0.02), Section.of_geometry(0.75, 0.04, 0.01)),
    (0.025, 0.0, 1e-3, 0.11),
)
STEP = 12.7
PULSE = 0.004
# A few roundings for each of the some hundred reflections.
ROUNDING = 1e-12


def pulse(t: Array) -> Array:
    """One bow of sin^2 with a torque of 1 N m, then nothing."""
    return np.where(t < PULSE, np.sin(math.pi * t / PULSE) ** 2, 0.0)


def bow(t: Array) -> Array:
    """A steady 0.5 N m less an oscillation at 300 Hz: from rest without a jump."""
    return (1 - np.cos(2 * math.pi * 300 * t)) / 2


def modal_speeds(omega: Array, shape_products: Array, t: Array) -> Array:
    """Speeds (points, times) from rest under `bow`, of modes with phi(x) phi(0) in the rows of shape_products."""
    drive = 2 * math.pi * 300
    phase = np.multiply.outer(omega, t)
    steady = t * np.sinc(phase / math.pi)
    swinging = (omega[:, None] * np.sin(phase) - drive * np.sin(drive * t)) / (omega**2 - drive**2)[:, None]
    return np.asarray(shape_products @ (steady - swinging) / 2)


def wave_energy(of: LineMotion) -> Array:
    """Energy in J at the end of each common step: of the discs, and of the waves on their way in each section."""
    q = of.rightward.shape[-1]
    squares = of.rightward**2 + of.leftward**2
    panels = np.einsum("pnq,q->pn", squares, 1 / (2 * np.arange(q) + 1)) * np.diff(of.edges)[:, None]
    sums = np.vstack([np.zeros(panels.shape[1]), np.cumsum(panels, axis=0)])
    counts = np.rint(np.arange(of.edges[-1] / of.step + 0.5)).astype(int)
    ends = np.searchsorted(of.edges, counts * of.step - of.step / 1e6)
    total = np.zeros(counts.size)
    for index, (section, multiple) in enumerate(zip(of.line.sections, common_step(of.line)[1], strict=True)):
        earlier = ends[np.maximum(counts - multiple, 0)]
        total += section.impedance * (sums[ends, index] - sums[earlier, index])
    for junction, disc in enumerate(of.line.discs):
        total[1:] += disc / 2 * of.junction_speeds[ends[1:] - 1, junction].sum(axis=-1) ** 2
    return total


def largest_difference(one: LineMotion, other: LineMotion, t: Array) -> float:
    """Difference of speeds and torques of two motions at the junctions, relative to the largest of each."""
    worst = 0.0
    for section in range(len(one.line.sections)):
        for ask in (
            lambda of, section=section: of.torque_in(section, t, "left"),
            lambda of, section=section: of.torque_in(section, t, "right"),
            lambda of, section=section: of.junction_speed(section, t),
            lambda of, section=section: of.junction_speed(section + 1, t),
        ):
            first, second = ask(one), ask(other)
            worst = max(worst, float(np.abs(first - second).max() / np.abs(first).max()))
    return worst


def test_a_step_on_a_bare_shaft_climbs_the_stairs_of_d_alembert() -> None:
    of = motion(SectionLine((SHAFT,), (0.0, 0.0)), [JunctionTorque(0, STEP)], 20 * SHAFT.delay)
    t = (np.arange(19) + 0.5) * SHAFT.delay
    step = STEP / SHAFT.impedance
    arrivals = np.floor(t / SHAFT.delay)
    assert of.junction_speed(0, t) == pytest.approx(step * (1 + 2 * (arrivals // 2)), rel=ROUNDING)
    assert of.junction_speed(1, t) == pytest.approx(step * 2 * ((arrivals + 1) // 2), rel=ROUNDING)
    assert of.torque(0.5, t - SHAFT.delay / 4) == pytest.approx(np.where(arrivals % 2, STEP, 0.0), abs=STEP * ROUNDING)


@pytest.mark.parametrize(("end", "reflected"), [("free", 1.0), ("clamped", -1.0)])
def test_a_free_end_returns_the_speed_and_a_clamped_end_turns_its_sign(end: End, reflected: float) -> None:
    line = SectionLine((SHAFT,), (0.0, 0.0), dampers=(SHAFT.impedance, 0.0), ends=("free", end))
    of = motion(line, [JunctionTorque(0, pulse, (PULSE,))], PULSE + 2 * SHAFT.delay)
    t = np.linspace(0.0, PULSE, 100)
    sent = pulse(t) / (2 * SHAFT.impedance)
    back = reflected * pulse(t - 1.5 * SHAFT.delay) * (t > 1.5 * SHAFT.delay) / (2 * SHAFT.impedance)
    passed = of.speed(0.25, t + 0.25 * SHAFT.delay)
    assert passed == pytest.approx(sent + back, abs=ROUNDING)


def test_an_end_with_a_damper_of_the_shafts_impedance_returns_nothing() -> None:
    line = SectionLine((SHAFT,), (0.0, 0.0), dampers=(0.0, SHAFT.impedance))
    of = motion(line, [JunctionTorque(0, pulse, (PULSE,))], 2 * PULSE)
    t = np.linspace(0.0, PULSE, 100)
    assert of.speed(0.5, t + SHAFT.delay / 2) == pytest.approx(pulse(t) / SHAFT.impedance, abs=ROUNDING)
    # u - a_in at the matched end: the rounding of one subtraction.
    assert np.abs(of.leftward).max() < 1e-15 * np.abs(of.rightward).max()


def test_a_light_disc_answers_a_step_with_its_exponential_front() -> None:
    disc = 1e-8  # its time constant is 1e-4 of the delay
    of = motion(SectionLine((SHAFT,), (disc, 0.0)), [JunctionTorque(0, STEP)], 2 * SHAFT.delay)
    t = np.concatenate([np.geomspace(1e-11, 1e-6, 50), np.linspace(1e-6, 1.999 * SHAFT.delay, 50)])
    expected = -np.expm1(-t * SHAFT.impedance / disc) * STEP / SHAFT.impedance
    assert of.junction_speed(0, t) == pytest.approx(expected, abs=ROUNDING * STEP / SHAFT.impedance)


def test_the_modes_of_the_shaft_add_up_to_its_motion() -> None:
    of = motion(POPENDA, [JunctionTorque(0, bow)], 0.05)
    shapes = modes(POPENDA, 3000)
    t = np.linspace(0.0, 0.05, 40)
    angles = shapes.angles(POPENDA.junctions)
    expected = modal_speeds(2 * math.pi * shapes.frequencies, (angles * angles[:, :1]).T, t)
    scale = np.abs(expected).max()
    for junction in (0, 1):
        # The modes left out are worth (300 Hz / 1.6 kHz)^2 times 3000^-3 of the first.
        assert of.junction_speed(junction, t) == pytest.approx(expected[junction], abs=1e-11 * scale)


@pytest.mark.parametrize("disc", [0.11, 0.025])
def test_the_modes_of_the_shaft_of_popenda_add_up_to_its_motion_under_a_step(disc: float) -> None:
    line = SectionLine((SHAFT,), (0.025, disc))
    of = motion(line, [JunctionTorque(0, STEP)], 0.2)
    shapes = modes(line, 5000)
    omega, angles = 2 * math.pi * shapes.frequencies, shapes.angles(line.junctions)
    t = np.linspace(0.0, 0.2, 101)
    swings = t * np.sinc(np.multiply.outer(omega, t) / math.pi)
    for junction in (0, 1):
        expected = STEP * (angles[:, junction] * angles[:, 0]) @ swings
        # The share of mode k is 5e-6 k^-3 of the whole, the modes left out are worth 1e-13.
        assert of.junction_speed(junction, t) == pytest.approx(expected, abs=ROUNDING * np.abs(expected).max())


@pytest.mark.parametrize(("station", "side"), [(0.0, "right"), (0.7, "right"), (1.5, "left"), (1.5, "right")])
def test_a_stepped_line_moves_as_its_inverted_laplace_response(station: float, side: str) -> None:
    of = motion(STEPPED, [JunctionTorque(0, pulse, (PULSE,))], 0.02)
    t = np.array([0.0013, 0.0044, 0.011, 0.0199])
    period, shift, terms = 0.04, 25 / 0.04, 1 << 16
    omega = 2 * math.pi / period * np.arange(terms)
    s = shift + 1j * omega
    rate = 2 * math.pi / PULSE
    torque = -np.expm1(-s * PULSE) * rate**2 / (2 * s * (s**2 + rate**2))
    torque[0] /= 2
    response = laplace_response(STEPPED, s, 0)
    growth = 2 / period * np.exp(shift * t)
    where = np.array([station])
    waves = np.exp(1j * np.multiply.outer(t, omega))
    speed = growth * (waves @ (torque * response.speeds(where)[:, 0])).real
    through = growth * (waves @ (torque * response.torques(where, side=side)[:, 0])).real  # type: ignore[arg-type]
    # Terms left out fall with the cube of 4e3 periods a pulse; images are exp(-25) = 1e-11 of the motion.
    assert of.speed(station, t) == pytest.approx(speed, abs=2e-10 * np.abs(of.junction_speeds).max())
    assert of.torque(station, t, side=side) == pytest.approx(through, abs=2e-9)  # type: ignore[arg-type]


def chain_speeds(line: SectionLine, cells: int, t: Array) -> Array:
    """Speeds of the ends under `bow` of a chain of equal cells, the inertia of the outer two halved."""
    section = line.sections[0]
    step = section.length / cells
    inertia = np.full(cells + 1, section.inertia * step)
    inertia[[0, -1]] = inertia[[0, -1]] / 2 + np.array(line.discs)
    stiffness = section.stiffness / step
    own = stiffness * np.array([1, *[2] * (cells - 1), 1]) / inertia
    squares, vectors = eigh_tridiagonal(own, -stiffness / np.sqrt(inertia[1:] * inertia[:-1]))
    shapes = vectors[[0, -1]] / np.sqrt(inertia[[0, -1]])[:, None]
    return modal_speeds(np.sqrt(np.maximum(squares, 0.0)), shapes * shapes[0], t)


def test_a_fine_lumped_chain_comes_nearer_with_the_square_of_its_cells() -> None:
    line = SectionLine((SHAFT,), (1e-4, 2e-4))
    of = motion(line, [JunctionTorque(0, bow)], 0.005)
    t = np.linspace(0.0, 0.005, 60)
    exact = np.array([of.junction_speed(0, t), of.junction_speed(1, t)])
    errors = np.array([np.abs(chain_speeds(line, cells, t) - exact).max() for cells in (40, 80, 160, 320)])
    # The next term of the error is below one per cent of the first at 40 cells.
    assert errors[:-1] / errors[1:] == pytest.approx(np.full(3, 4.0), rel=0.03)
    assert errors[-1] < 1e-4 * np.abs(exact).max()


@pytest.mark.parametrize(
    "line", [POPENDA, STEPPED, SectionLine((SHAFT,), (0.025, 1e-7)), SectionLine((SHAFT,), (0.0, 0.0))]
)
def test_the_energy_is_the_work_of_the_torque_and_stays_when_it_ends(line: SectionLine) -> None:
    of = motion(line, [JunctionTorque(0, pulse, (PULSE,))], 0.1)
    energy = wave_energy(of)
    nodes, weights = np.polynomial.legendre.leggauss(24)
    work = 0.0
    for start, end in pairwise(np.unique([*of.edges[of.edges < PULSE], PULSE])):
        times = start + (end - start) * (nodes + 1) / 2
        work += float(weights @ (pulse(times) * of.junction_speed(0, times))) * (end - start) / 2
    later = energy[math.ceil(PULSE / of.step) :]
    assert later == pytest.approx(np.full(later.size, work), rel=ROUNDING)


@pytest.mark.slow
def test_energy_does_not_drift_in_ten_thousand_delays() -> None:
    of = motion(POPENDA, [JunctionTorque(0, pulse, (PULSE,))], 1e4 * SHAFT.delay)
    energy = wave_energy(of)
    # One rounding for each reflection, of random sign.
    assert energy[-1] == pytest.approx(energy[100], rel=ROUNDING)


def test_the_angular_momentum_is_the_impulse_of_the_torques() -> None:
    of = motion(STEPPED, [JunctionTorque(0, STEP), JunctionTorque(3, -4.0, ()), JunctionTorque(2, 1.0)], 0.03)
    t = 0.0293
    nodes, weights = np.polynomial.legendre.leggauss(12)
    momentum = sum(disc * of.junction_speed(j, np.array(t)) for j, disc in enumerate(STEPPED.discs))
    for index, section in enumerate(STEPPED.sections):
        # Kinks of the speed along a section lie where a panel of one of its two waves ends.
        elapsed = np.concatenate([t - of.edges, section.delay - (t - of.edges)])
        inside = elapsed[(elapsed > 0) & (elapsed < section.delay)]
        cuts = np.unique(np.concatenate([[0.0, section.delay], inside])) / section.delay * section.length
        for start, end in pairwise(cuts + STEPPED.junctions[index]):
            speeds = [of.speed(x, np.array(t)) for x in start + (end - start) * (nodes + 1) / 2]
            momentum += section.inertia * float(weights @ np.array(speeds)) * (end - start) / 2
    assert momentum == pytest.approx((STEP - 4.0 + 1.0) * t, rel=ROUNDING)


@pytest.mark.parametrize("disc", [0.11, 0.025])
def test_the_step_on_the_shaft_of_popenda_does_not_depend_on_the_order(disc: float) -> None:
    line = SectionLine((SHAFT,), (0.025, disc))
    of, finer = (motion(line, [JunctionTorque(0, STEP)], 0.2, order=order) for order in (16, 24))
    t = np.linspace(0.0, 0.2, 2001)
    difference = largest_difference(of, finer, t)
    assert of.error < ROUNDING
    assert difference < ROUNDING
    assert difference < 10 * of.error


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_the_estimated_error_of_random_lines_bounds_the_difference_from_a_higher_order(seed: int) -> None:
    draw = np.random.default_rng(seed)
    parts = int(draw.integers(1, 4))
    sections = []
    for multiple in draw.integers(1, 5, parts):
        impedance, inertia = 10 ** draw.uniform([-2, -3], [2, 1])
        sections.append(Section(multiple * 1e-3 * impedance / inertia, inertia, impedance**2 / inertia))
    discs = 10 ** draw.uniform(-6, 3, parts + 1) * (draw.random(parts + 1) > 0.3)
    line = SectionLine(
        tuple(sections), tuple(discs.tolist()), ends=("free", "clamped" if draw.random() < 0.5 else "free")
    )
    start = draw.uniform(0, 0.02)
    late = JunctionTorque(parts - 1, lambda t: np.where(t < start, 0.0, np.cos(200 * (t - start))), (start,))
    of, finer = (motion(line, [JunctionTorque(0, 1.0), late], 0.05, order=order) for order in (16, 25))
    t = draw.uniform(0, 0.05, 200)
    scale = max(float(np.abs(part).max()) for part in (of.junction_speeds, of.rightward, of.leftward))
    difference = 0.0
    for index, section in enumerate(sections):
        speeds = of.junction_speed(index, t) - finer.junction_speed(index, t)
        torques = of.torque_in(index, t, "right") - finer.torque_in(index, t, "right")
        difference = max(difference, float(np.abs(speeds).max()), float(np.abs(torques).max()) / section.impedance)
    # The estimate is of the size of the error, not a proven bound.
    assert difference < 10 * of.error * scale
    assert of.error < 10 * ROUNDING


def test_a_shaft_in_parts_moves_like_the_whole_shaft() -> None:
    parts = tuple(Section.of_geometry(length, 0.02) for length in (0.2, 0.3, 0.5))
    whole = motion(POPENDA, [JunctionTorque(0, STEP, (0.011,))], 0.03)
    cut = motion(SectionLine(parts, (0.025, 0.0, 0.0, 0.11)), [JunctionTorque(0, STEP, (0.011,))], 0.03)
    assert cut.step == pytest.approx(SHAFT.delay / 10, rel=1e-14)
    t = np.linspace(0.0, 0.03, 500)
    for station in (0.0, 0.35, 1.0):
        for ask in (LineMotion.speed, LineMotion.torque):
            expected = ask(whole, station, t)
            assert ask(cut, station, t) == pytest.approx(expected, abs=ROUNDING * np.abs(expected).max())


def test_panels_end_at_breakpoints_and_at_all_their_echoes() -> None:
    late = JunctionTorque(1, lambda t: np.where(t < 0.0123, 0.0, np.sqrt(t)), (0.0123,))
    of = motion(POPENDA, [JunctionTorque(0, STEP), late], 0.03)
    for echo in range(20):
        assert np.abs(of.edges - (0.0123 + echo * SHAFT.delay)).min() < 1e-16
    assert of.error < ROUNDING
    finer = motion(POPENDA, [JunctionTorque(0, STEP), late], 0.03, order=24)
    assert largest_difference(of, finer, np.linspace(0.0, 0.03, 700)) < ROUNDING


def test_breakpoints_a_whole_number_of_delays_apart_share_their_panels() -> None:
    breakpoints = tuple(0.001 + number * SHAFT.delay for number in range(5))
    one, five = (motion(POPENDA, [JunctionTorque(0, STEP, given)], 0.03) for given in (breakpoints[:1], breakpoints))
    assert five.edges.tolist() == one.edges.tolist()


@pytest.mark.parametrize("line", [POPENDA, SectionLine((SHAFT,), (0.0, 0.11))])
def test_a_jump_that_is_not_given_is_found_by_halving_panels(line: SectionLine) -> None:
    def law(t: Array) -> Array:
        return np.where(t < 0.0123, 0.0, 1.0)

    given, found = (motion(line, [JunctionTorque(0, law, at)], 0.03) for at in ((0.0123,), ()))
    assert found.edges.size > 2 * given.edges.size
    # No time of comparison is within a rounding of an echo of the jump.
    assert largest_difference(given, found, np.linspace(0.0123, 0.03, 97)[1:]) < ROUNDING


def kloss(_: Array, speed: Array) -> Array:
    slip = (100.0 - speed) / 100.0
    return 2 * 9.6 * slip * 0.25 / (slip**2 + 0.25**2)


def reference_by_steps(discs: tuple[float, float], law: Callable[[Array, Array], Array], delays: int) -> list[Array]:
    """Speeds of both discs at the ends of the delays, by scipy's DOP853 from delay to delay."""
    delay, impedance = SHAFT.delay, SHAFT.impedance
    solved: list[Callable[[float], Array]] = []

    def waves(t: float) -> tuple[float, float]:
        """The waves that leave the left and the right end at a time."""
        if t < 0:
            return 0.0, 0.0
        left_speed, right_speed = solved[min(int(t / delay), len(solved) - 1)](t)
        arriving_right, arriving_left = waves(t - delay)
        return left_speed - arriving_left, right_speed - arriving_right

    def slope(t: float, speeds: Array) -> Array:
        arriving_right, arriving_left = waves(t - delay)
        torque = float(law(np.array(t), speeds[0]))
        left = (torque - impedance * (speeds[0] - 2 * arriving_left)) / discs[0]
        return np.array([left, -impedance * (speeds[1] - 2 * arriving_right) / discs[1]])

    speeds = [np.zeros(2)]
    for number in range(delays):
        # The end of a delay belongs to it: the waves there are those before the jump.
        span = (number * delay, (number + 1) * delay * (1 - 1e-15))
        done = solve_ivp(
            slope, span, speeds[-1], method="DOP853", rtol=1e-13, atol=1e-14, max_step=delay / 20, dense_output=True
        )
        solved.append(done.sol)
        speeds.append(done.y[:, -1])
    return speeds


def test_a_motor_with_kloss_curve_starts_as_in_the_method_of_steps() -> None:
    discs = (1e-4, 3e-4)
    expected = np.array(reference_by_steps(discs, kloss, 8))
    of = motion(SectionLine((SHAFT,), discs), [JunctionTorque(0, kloss, of_speed=True)], 8 * SHAFT.delay)
    t = np.arange(9) * SHAFT.delay
    # DOP853 interpolates the waves with order 7: (delay / 20)^8 of fronts that take a delay.
    scale = np.abs(expected).max()
    assert of.junction_speed(0, t) == pytest.approx(expected[:, 0], abs=1e-10 * scale)
    assert of.junction_speed(1, t) == pytest.approx(expected[:, 1], abs=1e-10 * scale)
    assert of.error < ROUNDING


@pytest.mark.parametrize("disc", [0.02, 0.0])
def test_a_linear_law_of_the_speed_is_a_damper(disc: float) -> None:
    lines = [SectionLine((SHAFT,), (disc, 0.11), dampers=(damper, 0.0)) for damper in (0.0, 0.3)]
    law = JunctionTorque(0, lambda _, speed: -0.3 * speed, of_speed=True)
    with_law = motion(lines[0], [JunctionTorque(0, STEP), law], 0.02)
    with_damper = motion(lines[1], [JunctionTorque(0, STEP)], 0.02)
    assert largest_difference(with_damper, with_law, np.linspace(0.0, 0.02, 333)) < ROUNDING


@pytest.mark.slow
def test_a_law_that_jumps_with_the_speed_is_refused() -> None:
    friction = JunctionTorque(0, lambda _, speed: -0.3 * np.sign(speed), of_speed=True)
    drive = JunctionTorque(1, lambda t: np.sin(2000 * t))
    with pytest.raises(SimulationError, match="make torques smooth in the speed"):
        motion(SectionLine((SHAFT,), (0.0, 1e-4)), [friction, drive], 0.02)


def test_a_turning_shaft_without_torque_turns_on_and_a_clamp_stops_it() -> None:
    t = np.linspace(0.0, 0.01, 50)
    free = motion(STEPPED, [], 0.01, initial_speed=5.0)
    assert free.junction_speed(1, t) == pytest.approx(np.full(50, 5.0), rel=ROUNDING)
    held = motion(SectionLine((SHAFT,), (0.0, 0.0), ends=("clamped", "free")), [], 0.01, initial_speed=5.0)
    # The front of the stop runs to the free end and back.
    assert held.torque_in(0, np.array([0.5, 1.5, 2.5]) * SHAFT.delay, "left") == pytest.approx(
        SHAFT.impedance * 5.0 * np.array([-1, -1, 1]), rel=ROUNDING
    )


@pytest.mark.parametrize(
    ("line", "torques", "text"),
    [
        (
            SectionLine((SHAFT, Section.of_geometry(math.sqrt(2), 0.02)), (0.0,) * 3),
            [],
            "not multiples of one common step",
        ),
        (SectionLine((Section(1.0, 1.0, 1.0, damping=0.1),), (0.0, 0.0)), [], "without damping and friction"),
        (SectionLine((SHAFT,), (0.0, 0.0), ends=("clamped", "free")), [JunctionTorque(0, 1.0)], "junction is clamped"),
        (POPENDA, [JunctionTorque(2, 1.0)], "no junction 2"),
    ],
)
def test_what_characteristics_cannot_do_is_refused(line: SectionLine, torques: list[JunctionTorque], text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        motion(line, torques, 0.01)


def test_a_torque_that_is_not_finite_and_a_time_after_the_end_are_refused() -> None:
    with pytest.raises(SimulationError, match="junction 0 is not finite"):
        motion(POPENDA, [JunctionTorque(0, math.nan)], 0.01)
    with pytest.raises(ParameterError, match="known up to"):
        motion(POPENDA, [], 0.01).junction_speed(0, np.array([0.011]))
    with pytest.raises(ParameterError, match="t_end above 0"):
        motion(POPENDA, [], 0.0)
