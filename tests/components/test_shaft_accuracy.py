"""Models of shafts against exact frequencies and damping: their orders, their spurious modes, the printed equations."""

from __future__ import annotations

import numpy as np
import pytest

import shaftwork as sw
from tests.components.test_shafts import INERTIA, STEEL, STIFFNESS, TRUE, train
from tests.reference.exact_shafts.line import Section, SectionLine
from tests.reference.line_modes import natural_frequencies


def eigenvalues(model: object, load: float = 0.11, **shaft: float) -> np.ndarray:
    """Those of the oscillating motions, in 1/s, by rising frequency."""
    compiled = train(model, load, **shaft).compile()
    found = np.linalg.eigvals(compiled.jacobian(0.0, np.zeros(len(compiled.states))).toarray())
    return np.sort_complex(1j * found[found.imag > 1.0])[::-1] / 1j


def frequencies(model: object, load: float = 0.11) -> np.ndarray:
    """Natural frequencies in Hz, rising, without the rigid motion."""
    return eigenvalues(model, load).imag / (2 * np.pi)


def exact_frequencies(load: float = 0.11, motor: float = 0.025, count: int = 4) -> np.ndarray:
    """The lowest of the lossless shaft in Hz, by the transcendental equation, without the rigid motion."""
    return natural_frequencies(
        SectionLine((Section.of_geometry(1.0, 0.02, density=7900.0, shear_modulus=77.5e9),), (motor, load)), count + 1
    )[1:]


def errors_of_frequencies(model: object, exact: np.ndarray) -> np.ndarray:
    """Relative, of the lowest; modes of central differences of order 2 come in twins, of which the better counts."""
    found = frequencies(model)
    if isinstance(model, sw.CentralDifference) and model.order == 2:
        twins = [found[:1], *(found[k : k + 2] for k in range(1, 2 * len(exact) - 1, 2))]
    else:
        twins = [found[k : k + 1] for k in range(len(exact))] if isinstance(model, sw.Lumped) else [found] * len(exact)
    return np.array([np.abs(each / true - 1).min() for each, true in zip(twins, exact, strict=True)])


@pytest.mark.parametrize("load", TRUE)
def test_spectral_frequencies_are_true(load: float) -> None:
    # the reference has ten digits
    np.testing.assert_allclose(frequencies(sw.Spectral(16), load)[:3], TRUE[load], rtol=1e-10)


def fourth(m: int) -> sw.CentralDifference:
    return sw.CentralDifference(m, order=4)


def printed(m: int) -> sw.CentralDifference:
    return sw.CentralDifference(m, closure="printed")


def halved(m: int) -> sw.CentralDifference:
    return sw.CentralDifference(m, second_difference="printed")


def equal_lumps(m: int) -> sw.Lumped:
    return sw.Lumped(m, ends="full")


@pytest.mark.parametrize(
    ("model", "order", "modes", "sizes"),
    [
        (sw.Lumped, 2, (0, 1, 2, 3), (10, 20, 40, 80)),
        (sw.CentralDifference, 2, (0, 1, 2, 3), (10, 20, 40, 80)),
        (fourth, 4, (1, 2), (20, 40, 80)),  # the first mode is at rounding
        (equal_lumps, 1, (0, 1, 2), (20, 40, 80)),
        (printed, 1, (0,), (10, 20, 40, 80)),  # the inertia it lacks is small beside the heavy ends' in the other modes
    ],
    ids=["lumped", "central", "central of order 4", "equal lumps", "printed closure"],
)
def test_the_order_of_convergence_of_the_frequencies(
    model: object, order: int, modes: tuple[int, ...], sizes: tuple[int, ...]
) -> None:
    exact = exact_frequencies()
    np.testing.assert_allclose(exact[:3], TRUE[0.11], rtol=1e-9)
    found = [errors_of_frequencies(model(m), exact) for m in sizes]
    for mode in modes:
        errors = np.array([each[mode] for each in found])
        # the next term of the error changes the exponent by 0.2 at these sizes
        assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("m", [10, 20, 40, 80])
def test_central_differences_are_four_times_worse_than_lumps_at_equal_size(m: int) -> None:
    """Their difference spans two intervals, so that the error is that of a chain of half as many."""
    exact = exact_frequencies()
    lumped, central = (errors_of_frequencies(model, exact)[1:] for model in (sw.Lumped(m), sw.CentralDifference(m)))
    # the next term is (pi k / m)^2 / 20 of it, with k = 3 half waves at most; heavy ends are not clamped ones: 0.002
    np.testing.assert_allclose(central / lumped, 4.0, rtol=0.002 + (3 * np.pi / m) ** 2 / 20)


def test_the_printed_closure_is_of_first_order_with_light_ends_too() -> None:
    """It lacks half a cell of inertia at each end, a hundredth of the lowest frequency at m = 20."""
    exact, errors = exact_frequencies(1e-4, 1e-4)[0], []
    for m in (20, 40, 80):
        net = sw.Network("light ends")
        net.add(sw.Inertia("Je", J=1e-4), "m")
        net.add(sw.Shaft("line", **STEEL, model=printed(m)), "m", "l")
        net.add(sw.Inertia("Jm", J=1e-4), "l")
        errors.append(np.abs(net.modes().frequencies / exact - 1).min())
    assert errors[0] == pytest.approx(0.012, rel=0.01)
    # the next term changes the exponent by 0.04
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(1, abs=0.05)


def test_central_differences_have_twice_the_modes() -> None:
    """Every mode but the first comes a second time, as one that lives on the odd and even nodes in turn."""
    below = {
        repr(model): (frequencies(model) < 4750.0).sum()
        for model in (sw.Lumped(10), sw.Spectral(10), sw.CentralDifference(10), printed(10))
    }
    assert (exact_frequencies(count=5) < 4750.0).sum() == 4
    assert list(below.values()) == [4, 4, 9, 8]


@pytest.mark.slow
def test_the_damping_of_every_mode_is_right_to_second_order_and_half_of_it_as_printed() -> None:
    """The exact one: damping that goes with the stiffness keeps the modes, and zeta = D' omega / (2 C')."""
    omega = 2 * np.pi * exact_frequencies(count=3)
    damping = 0.1 * STIFFNESS / omega[1]  # 5 % of the second mode
    zeta = damping * omega / (2 * STIFFNESS)
    exact = omega * (-zeta + 1j * np.sqrt(1 - zeta**2))
    sizes = (20, 40, 80)

    def ratios(model: object, m: int) -> np.ndarray:
        found = eigenvalues(model(m), damping=damping)
        nearest = [found[np.abs(found - s).argmin()] for s in exact]
        return np.array([-s.real / abs(s) for s in nearest]) / zeta

    for model in (sw.Lumped, sw.CentralDifference, fourth, printed):
        errors = np.abs([ratios(model, m)[1:] - 1 for m in sizes])
        # nearly undamped, the first mode is at rounding of what the others are; those of order 4 begin late
        np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 2.0, atol=0.2)
    for m in sizes:
        np.testing.assert_allclose(ratios(halved, m), 0.5, rtol=(2 * np.pi / m) ** 2)


def test_the_damping_takes_the_spurious_modes_away() -> None:
    """A thousandth of damping in the second mode; neighbours that turn against each other are damped 600 times more."""
    damping = 0.002 * STIFFNESS / (2 * np.pi * exact_frequencies()[1])
    found = eigenvalues(sw.CentralDifference(40), damping=damping)
    low = found[np.abs(found) < 2 * np.pi * 2000]
    ratios = -low.real / np.abs(low)
    assert (ratios < 0.0011).sum() == 2
    assert (ratios[ratios > 0.0011] > 0.5).all()


def test_the_printed_closure_is_the_printed_equations() -> None:
    """(20)-(23) of Popenda 2019 as a matrix, written out by hand."""
    m, damping = 6, 0.4
    dx, J, C = 1 / m, INERTIA, STIFFNESS
    model = train(sw.CentralDifference(m, closure="printed", second_difference="printed"), damping=damping).compile()
    A = model.jacobian(0.0, np.zeros(len(model.states))).toarray()
    names = [
        "Je.omega",
        *(f"line.omega_{k}" for k in range(1, m)),
        "Jm.omega",
        *(f"line.tau_c_{k}" for k in range(1, m)),
    ]
    order = [model.states.index(name) for name in names]
    A = A[np.ix_(order, order)]
    by_hand = np.zeros((2 * m, 2 * m))
    inertias = [0.025, *[J * dx] * (m - 1), 0.11]
    torque = dict(enumerate(range(m + 1, 2 * m), 1))  # column of M_k
    torque |= {0: torque[1], m: torque[m - 1]}
    by_hand[0, torque[1]] -= 1 / 0.025  # (22)
    by_hand[m, torque[m - 1]] += 1 / 0.11  # (23)
    for k in range(1, m):  # (21)
        by_hand[k, torque[k + 1]] -= 1 / (2 * J * dx)
        by_hand[k, torque[k - 1]] += 1 / (2 * J * dx)
    for k in range(2, m - 1):  # (20)
        by_hand[torque[k], [k + 1, k - 1]] = -C / (2 * dx), C / (2 * dx)
    for row, end, inner in ((torque[1], 0, (1, 2)), (torque[m - 1], m, (m - 1, m - 2))):
        sign = 1 if end == 0 else -1
        by_hand[row, [end, *inner]] = np.array([1, -1 / 2, -1 / 2]) * sign * C / (1.5 * dx)
    for k in range(m):  # the second difference over 2 dx^2
        for node, other in ((k, k + 1), (k + 1, k)):
            by_hand[node, [node, other]] += np.array([-1, 1]) * damping / (2 * dx * inertias[node])
    np.testing.assert_allclose(A, by_hand, rtol=1e-12, atol=1e-9)  # entries to 1e6


def test_the_printed_closure_needs_something_at_its_ends() -> None:
    """They have no inertia of the shaft."""
    net = sw.Network("bare")
    net.add(sw.Inertia("Je", J=0.025), "m")
    net.add(sw.Shaft("line", **STEEL, model=printed(10)), "m", "l")
    with pytest.raises(sw.NetworkError, match="loose end: node 'l': only Shaft 'line' ends there, with its port b"):
        net.compile()


@pytest.mark.slow
def test_the_torque_along_central_differences_is_that_of_springs_and_dampers() -> None:
    """Heavily damped: the torque at a third of the length, to the order of each model."""
    exact, central, as_printed = (
        train(model, damping=5.0).simulate(0.01, t_eval=[0.002, 0.005, 0.01])
        for model in (sw.Spectral(12), sw.CentralDifference(21), printed(21))
    )
    place = 7  # of 22, from 0 to 1
    at_a_third = [np.interp(1 / 3, exact.places["line.tau"], row) for row in exact["line.tau"]]
    # interpolation of Spectral(12) is good to 6e-6, the printed closure is of first order
    for sol, tolerance in ((central, 1e-5), (as_printed, 2e-4)):
        assert sol.places["line.tau"][place] == pytest.approx(1 / 3, rel=1e-12)
        np.testing.assert_allclose(sol["line.tau"][:, place], at_a_third, rtol=tolerance)
