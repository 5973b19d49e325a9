"""A brushless motor on its six-step inverter, typed by hand as a circuit for ngspice, and what ngspice made of it.

Speed is the voltage of node w, torque the current into it, the rotor's inertia a capacitor; the voltage of node phi is
the angle of the rotor. Switches are closed where the voltage of their gate is above zero: the sine of the electrical
angle beyond one half. They are not ideal: 1 uohm when closed and 100 kohm when open, and diodes that drop some mV. All
this changes a current by less than 1e-5 of the largest (`IMPERFECT`): 2e-6 by the closed switches at a locked rotor.

    python -m tests.reference.ngspice.bldc          writes bldc.json anew
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.reference.ngspice.runner import run_ngspice

Array = NDArray[np.float64]
STORE = Path(__file__).with_suffix(".json")
SIGNALS = ("i(Va)", "i(Vb)", "i(Vc)", "v(w)")
"""Currents of the phases and the speed."""
IMPERFECT = 1e-5
OPTIONS = "reltol=1e-6 abstol=1e-9 vntol=1e-6 chgtol=1e-12 method=trap"
"""Finer ones stop ngspice: it then halves its step for the rounding of the voltage of an open leg."""
K, RATED, INERTIA = 212 / (100 * math.pi), 12.73, 0.025

MOTOR = f"""
.param k={K!r} third={2 * math.pi / 3!r} steep={6 / math.pi!r}
.func back(x) {{steep*asin(max(-0.5,min(0.5,sin(x))))}}
.model switch SW(vt=0 vh=0 ron=1u roff=100k)
.model diode D(is=1e-9 n=0.005)
Bgate1 ga 0 V=sin(2*V(phi))-0.5
Bgate2 gb 0 V=sin(2*V(phi)-third)-0.5
Bgate3 gc 0 V=sin(2*V(phi)+third)-0.5
Bgate4 ha 0 V=-sin(2*V(phi))-0.5
Bgate5 hb 0 V=-sin(2*V(phi)-third)-0.5
Bgate6 hc 0 V=-sin(2*V(phi)+third)-0.5
S1 p la ga 0 switch
S2 p lb gb 0 switch
S3 p lc gc 0 switch
S4 la n ha 0 switch
S5 lb n hb 0 switch
S6 lc n hc 0 switch
D1 la p diode
D2 lb p diode
D3 lc p diode
D4 n la diode
D5 n lb diode
D6 n lc diode
Va la ra 0
Vb lb rb 0
Vc lc rc 0
Ra ra xa 0.5
Rb rb xb 0.5
Rc rc xc 0.5
La xa ea 9m
Lb xb eb 9m
Lc xc ec 9m
Bea ea star V=k*V(w)*back(2*V(phi))
Beb eb star V=k*V(w)*back(2*V(phi)-third)
Bec ec star V=k*V(w)*back(2*V(phi)+third)
Bturn 0 phi I=V(w)
"""
SUPPLIES = {
    "direct": "Vupper p 0 270\nVlower n 0 -270",
    "pulsed": """
Bchop chop 0 V=cos(2*pi*1000*time)-cos(pi*0.3)
Bupper p 0 V=270*u(V(chop))
Blower n 0 V=-270*u(V(chop))
""",
    "controlled": """
Blag lag 0 V=12+4*sin(200*time)-(abs(I(Va))+abs(I(Vb))+abs(I(Vc)))/2
Bwant want 0 V=20*V(lag)+V(control)
Blimited limited 0 V=min(540,max(0,V(want)))
Bintegral 0 control I=V(lag)+(V(limited)-V(want))/20
Cintegral control 0 250u
Bchop chop 0 V=cos(2*pi*2000*time)-cos(pi*V(limited)/540)+(V(want)-V(limited))/540
Bupper p 0 V=270*u(V(chop))
Blower n 0 V=-270*u(V(chop))
""",
}
"""Direct voltage; pulses around whole milliseconds, on for 0.3 of the time; and the same of 2 kHz by a PI controller of
20 V/A and 5 ms for 12 A that swing, with limits of 0 and 540 V and back-calculation."""
ROTOR = f"""
Btorque 0 w I=k*(I(Va)*back(2*V(phi))+I(Vb)*back(2*V(phi)-third)+I(Vc)*back(2*V(phi)+third))
CJ w 0 {INERTIA}
Bload w 0 I={RATED}*tanh(V(w))
"""


@dataclass(frozen=True)
class Motion:
    """A motion of the motor.

    Args:
        start: angle of the rotor at first, rad.
        t_end: end, s.
        steps: time steps of ngspice, s, the second half of the first.
        locked: whether the rotor is held.
        supply: one of `SUPPLIES`.
    """

    start: float
    t_end: float
    steps: tuple[float, float]
    locked: bool = False
    supply: str = "direct"

    @property
    def times(self) -> Array:
        """Of the stored numbers, s."""
        return np.linspace(0.0, self.t_end, 101)[1:]

    @property
    def netlist(self) -> str:
        """The whole circuit."""
        held = "Vheld w 0 0" if self.locked else ROTOR
        return f"{MOTOR}{SUPPLIES[self.supply]}\n{held}\nCphi phi 0 1 ic={self.start!r}"

    def run(self, step: float) -> Array:
        """The signals at the times, shape (times, signals)."""
        t, values = run_ngspice(self.netlist, SIGNALS, self.t_end, step, OPTIONS)
        return np.column_stack([np.interp(self.times, t, column) for column in values.T])


MOTIONS = {
    "locked": Motion(math.pi / 6 + 0.05, 0.1, locked=True, steps=(8e-6, 4e-6)),
    "running": Motion(0.0, 0.05, locked=False, steps=(5e-7, 2.5e-7)),
    "pulsed": Motion(0.0, 0.025, steps=(2.5e-7, 1.25e-7), supply="pulsed"),
    "controlled": Motion(0.0, 0.03, steps=(2.5e-7, 1.25e-7), supply="controlled"),
}
"""At the angle of the locked rotor a is high, b is low and c is open."""


def stored(name: str) -> dict[str, Any]:
    """What ngspice made of a motion: "values" as `Motion.run`, and "change", what half the step changed in them.

    The change is relative to the largest current, or to the largest speed.
    """
    made: dict[str, Any] = json.loads(STORE.read_text(encoding="utf-8"))[name]
    return made


def _made(motion: Motion) -> dict[str, Any]:
    coarse, fine = (motion.run(step) for step in motion.steps)
    return {"change": largest(fine - coarse, fine), "values": [[float(f"{v:.9g}") for v in row] for row in fine]}


def largest(difference: Array, of: Array) -> list[float]:
    """Of currents over the largest current, and of speeds over the largest speed; 0 where all speeds are."""
    parts = ((np.abs(difference[:, k]).max(), np.abs(of[:, k]).max()) for k in (slice(0, 3), slice(3, 4)))
    return [float(top / bottom) if bottom else float(top) for top, bottom in parts]


if __name__ == "__main__":
    STORE.write_text(json.dumps({name: _made(motion) for name, motion in MOTIONS.items()}, indent=1) + "\n", "utf-8")
