"""Every state of a network has a name of its own: laws and results are found by it."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.components.base import REGISTRY
from shaftwork.formulation.form import state_form
from shaftwork.formulation.view import View

with patch.dict(REGISTRY):  # the documentation and other tests list the parts of the package alone

    @sw.component
    class Stiffening(sw.Component):
        """Two couplings in one part that stiffen with the cube of their twist."""

        k: float = sw.parameter("N*m/rad^3", "stiffness", above=0)
        ports = (sw.Port("a"), sw.Port("b"), sw.Port("c"))

        def branches(self, p):
            yield sw.ThroughLaw(p.k * sw.INTEGRAL**3, ("a", "b"), "left")
            yield sw.ThroughLaw(2 * p.k * sw.INTEGRAL**3, ("b", "c"))

    @sw.component
    class Twins(sw.Component):
        """Two inertias that the author did not tell apart."""

        J: float = sw.parameter("kg*m^2", "inertia", above=0)

        def branches(self, p):
            yield sw.AcrossStore(p.J, ("a", None))
            yield sw.AcrossStore(p.J, ("b", None))

    @sw.component
    class Servo(sw.Component):
        """A prescribed difference of speeds beside a spring that it winds up."""

        c: float = sw.parameter("N*m/rad", "stiffness", above=0)

        def branches(self, p):
            yield sw.AcrossLaw(3)
            yield sw.ThroughStore(p.c)


def three(part: sw.Component, *nodes: str) -> sw.Network:
    net = sw.Network("three")
    for name in nodes:
        net.add(sw.Inertia(f"J{name}", J=1.0), name)
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(part, *nodes)
    return net


def test_two_twists_of_one_part_are_two_states() -> None:
    """With one name for both, laws read the wrong twist: the energy balance did not close."""
    whole = three(Stiffening("two", k=10.0), "a", "b", "c")
    assert whole.compile().states[-2:] == ("two.phi_left", "two.phi_2")
    apart = three(sw.TorqueSource("one", tau=-10 * sw.phi**3), "a", "b")
    apart.add(sw.Inertia("Jc", J=1.0), "c")
    apart.add(sw.TorqueSource("other", tau=-20 * sw.phi**3), "b", "c")
    runs = [net.simulate(2.0, engine="scipy", rtol=1e-10, t_eval=9) for net in (whole, apart)]
    np.testing.assert_allclose(runs[0]["Jc.omega"], runs[1]["Jc.omega"], rtol=1e-12, atol=1e-12)
    assert runs[0].energy_residual < 1e-9
    latex = whole.equations().latex("state")
    assert r"\varphi_{\mathrm{left},\mathrm{two}}^{3}" in latex
    assert r"\varphi_{2,\mathrm{two}}^{3}" in latex or r"\varphi_{\mathrm{two},2}^{3}" in latex


def test_two_stores_of_one_name_are_refused_by_it() -> None:
    with pytest.raises(
        sw.NetworkError, match=r"'twins'.*two of its stores have the name 'omega'; give each branch a label"
    ):
        three(Twins("twins", J=1.0), "a", "b").compile()


def test_what_a_prescribed_speed_takes_is_told_from_the_store_beside_it() -> None:
    net = three(Servo("servo", c=7.0), "a", "b")
    flows = [flow.branches for flow in net.equations().assembly.quantities.flows if flow.part == 3]
    assert len(flows) == 2
    assert r"\frac{d \tau_{c,\mathrm{servo}}}{d t} &= c_{\mathrm{servo}}" in net.equations().latex()
    assert net.equations().document()


def test_messages_name_the_nodes_of_the_user_and_those_inside_parts_only_where_there_are_no_others() -> None:
    net = sw.Network("line")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Shaft("shaft", length=1.0, diameter=0.1, model=sw.Lumped(3)), "a", "b")
    graph = net.compile().form.graph
    inner = [number for number, name in enumerate(graph.nodes) if "." in name]
    view = View(state_form(graph))
    assert view.nodes([graph.nodes.index("a"), *inner]) == ("a",)
    assert view.nodes(inner) == tuple(graph.nodes[number] for number in inner)
