"""Parts that change their mode in C: all sets of equations, and modes, guards and transitions as tables."""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import product
from typing import TYPE_CHECKING, Any

from sympy import Expr, Float, Integer, Piecewise

from shaftwork.ccode.c_printing import Statements, array, function, text_of
from shaftwork.ccode.c_texts import runtime
from shaftwork.ccode.equation_set import EquationSet
from shaftwork.ccode.set_functions import SetFunctions, function_of_sets
from shaftwork.codegen.state_transfer import WITHOUT_INERTIA, StateTransfer
from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import Leave
from shaftwork.core.errors import CompileError, NetworkError
from shaftwork.hybrid.consistency import rounding_moves
from shaftwork.hybrid.modes.mode_machines import ModeGuards, ModeMachine, ModeNames
from shaftwork.network.graph import GROUND
from shaftwork.network.netlist import listed

if TYPE_CHECKING:
    from shaftwork.hybrid.hybrid_model import HybridModel

MOST_SETS = 256
"""Sets of equations: more would make code that takes minutes to compile."""


class ModeTables:
    """What changes its mode in a network.

    Args:
        model: the compiled network.

    Raises:
        CompileError: there are too many sets of equations, or a gear passes on torques by their direction.
    """

    def __init__(self, model: HybridModel) -> None:
        self._model, self._sets = model, model.equation_sets
        self._machines: tuple[ModeMachine, ...] = self._sets.machines
        self._refuse()

    def _refuse(self) -> None:
        title = self._model.name
        count = math.prod(map(len, self._forms))
        if count > MOST_SETS:
            raise CompileError(
                f"'{title}' has {count} sets of equations, of all combinations in which {listed(self.machines)} are "
                f"rigid, and C code has at most {MOST_SETS}. Give contacts a stiffness c, or simulate it here."
            )
        gears = [machine for machine in self._machines if machine.modes.passes_on]
        others = [machine.name for machine in self._machines if machine not in gears and _strikes(machine)]
        if self._model.form.loses_power and (others or any(one.form.has_impulses for one in self.sets)):
            struck = f"beside {listed(others)}" if others else "behind a source that jumps"
            raise CompileError(
                f"{listed([gear.name for gear in gears])} of '{title}' loses power by the direction of its torque, "
                f"{struck}: of impacts through it there is no C code. Take efficiency=1, or a stiffness c of contacts."
            )

    @cached_property
    def _forms(self) -> list[list[str]]:
        """The forms of each machine."""
        return [[*dict.fromkeys(mode.form for mode in machine.modes.options)] for machine in self._machines]

    @property
    def machines(self) -> list[str]:
        """Names of the parts, or pieces of parts, that change their mode."""
        return [machine.name for machine in self._machines]

    @property
    def numbers(self) -> list[str]:
        """Names of the numbers of their modes in laws."""
        return [machine.number for machine in self._machines]

    @cached_property
    def _by_forms(self) -> dict[tuple[str, ...], Any | None]:
        """The model of each combination of forms; None where its equations contradict each other."""
        models: dict[tuple[str, ...], Any | None] = {}
        for forms in product(*self._forms):
            try:
                models[forms] = self._sets.of(self._of_forms(forms)).model
            except NetworkError:
                models[forms] = None
        return models

    def _of_forms(self, forms: Sequence[str]) -> ModeNames:
        """A combination of modes that has the forms."""
        pairs = zip(self._machines, forms, strict=True)
        return tuple(next(m.name for m in machine.modes.options if m.form == form) for machine, form in pairs)

    @cached_property
    def sets(self) -> tuple[EquationSet, ...]:
        """The sets of equations; the first one is that in which nothing is rigid."""
        return tuple(EquationSet(model) for model in self._by_forms.values() if model is not None)

    @cached_property
    def _guards(self) -> list[ModeGuards]:
        """The guards of each set."""
        possible = [forms for forms, model in self._by_forms.items() if model is not None]
        pairs = zip(possible, self.sets, strict=True)
        return [ModeGuards(one.form, self._machines, forms, one.observables) for forms, one in pairs]

    @property
    def most_guards(self) -> int:
        """Guards of the set that has most."""
        return max(len(guards.expressions) for guards in self._guards)

    @cached_property
    def _leaves(self) -> dict[tuple[int, str, int], Leave]:
        """Each leave by machine, mode and place in it."""
        return {
            (k, mode.name, place): leave
            for k, machine in enumerate(self._machines)
            for mode in machine.modes.options
            for place, leave in enumerate(mode.leaves)
        }

    def _place(self, machine: int, mode: str) -> int:
        names = [one.name for one in self._machines[machine].modes.options]
        return names.index(mode) if mode else -1

    @property
    def _most_modes(self) -> int:
        return max(len(machine.modes.options) for machine in self._machines)

    def texts(self, functions: Sequence[SetFunctions], statements: Statements) -> list[str]:
        """The functions and tables of all sets."""
        texts = [runtime("modes.c"), *self._tables()]
        assignments = [self._assignments(*pair) for pair in zip(functions, self._guards, strict=True)]
        for name in assignments[0]:
            texts += [function_of_sets(name, [one[name] for one in assignments], statements)]
        return [*texts, self._leave_numbers(functions[0], statements)]

    def _assignments(self, one: SetFunctions, guards: ModeGuards) -> Mapping[str, Mapping[str, Expr]]:
        """Of a set: guards, speeds across machines, where motions begin, and answers to impulses."""
        machines, size = enumerate(self._machines), self._most_modes
        parts = {part.name: part for part in one.form.graph.parts}
        fewer = [Float(0.0)] * (self.most_guards - len(guards.expressions))
        speeds, begins = list[Expr](), dict[str, Expr]()
        for k, machine in machines:
            part = parts[machine.part.name]
            speeds.append(one.observables.guard(part, machine.modes, ACROSS))
            for n, mode in enumerate(machine.modes.options):
                condition = Piecewise((Integer(1), mode.starts), (Integer(0), True))
                begins[f"holds[{k * size + n}]"] = one.observables.guard(part, machine.modes, condition)
        return {
            "guards": {f"g[{k}]": guard for k, guard in enumerate((*guards.expressions, *fewer))},
            "across": {f"speeds[{k}]": speed for k, speed in enumerate(speeds)},
            "begins": begins,
            "shares": dict(self._gains(one, speeds)),
        }

    def _gains(self, one: SetFunctions, speeds: Sequence[Expr]) -> Iterator[tuple[str, Expr]]:
        """What the speed across each machine has of that of each inertia; nothing where torques tell it as well."""
        symbols = one.rows.states[one.form.speeds]
        for k, (told, speed) in enumerate(zip(self._has_inertia(one), speeds, strict=True)):
            for j, symbol in enumerate(symbols if told else ()):
                if (gain := speed.diff(symbol)) != 0:
                    yield f"gains[{k} * NX + {j}]", gain

    def _has_inertia(self, one: EquationSet | SetFunctions) -> list[bool]:
        """Of each machine whether the speeds of inertias and prescribed ones tell the speed across it."""
        form, told = one.form, list[bool]()
        massless = {branch for kind in WITHOUT_INERTIA for branch in form.tree.tree[kind]}  # only asked for membership
        for machine in self._machines:
            part = next(part for part in form.graph.parts if part.name == machine.part.name)
            nodes = [part.node_at(end) for end in part.ends_of(machine.modes)]
            rows = [{} if node == GROUND else form.tree.potentials[node] or {} for node in nodes]
            trees = {tree for row in rows for tree in row if tree in massless}
            told.append(all(rows[0].get(tree, 0) == rows[1].get(tree, 0) for tree in trees))
        return told

    def _leave_numbers(self, one: SetFunctions, statements: Statements) -> str:
        """Restitution, speed of rest and twist at the limit of each leave that rebounds."""
        parts, lines = {part.name: part for part in one.form.graph.parts}, ["*restitution = *rest = *limit = 0.0;"]
        lines.append("switch (leave) {")
        for number, ((k, _, _), leave) in enumerate(self._leaves.items()):
            if leave.rebound is None:
                continue
            machine, slope = self._machines[k], leave.when.diff(INTEGRAL)
            limit = -leave.when.xreplace({INTEGRAL: Integer(0)}) / slope if slope else Integer(0)
            told = [leave.rebound, leave.rest if leave.rest is not None else Integer(0), limit]
            values = [one.observables.guard(parts[machine.part.name], machine.modes, value) for value in told]
            lines += [
                f"case {number}: {{",
                *(f"    {line}" for line in statements.assigned(["*restitution", "*rest", "*limit"], values)),
                "    break;",
                "}",
            ]
        head = "void leave_numbers(const NAME *m, int leave, double *restitution, double *rest, double *limit)"
        return function(head, [*lines, "default: break;", "}"])

    def _tables(self) -> Iterator[str]:
        """Modes, forms, leaves and watched guards."""
        machines, most = self._machines, self._most_modes
        forms, strides = self._forms, list[int]()
        for k in range(len(forms)):
            strides.append(math.prod(len(others) for others in forms[k + 1 :]))
        numbers = iter(range(len(self.sets)))
        sets = [-1 if model is None else next(numbers) for model in self._by_forms.values()]
        options = [[*machine.modes.options] for machine in machines]
        padded = [[*modes, *([None] * (most - len(modes)))] for modes in options]
        cells = [(machine, k, mode) for k, machine in enumerate(machines) for mode in padded[k]]
        longest = max((len(mode.leaves) for modes in options for mode in modes), default=1)
        yield f"enum {{ MOST_MODES = {most}, MOST_LEAVES = {max(longest, 1)}, N_LEAVES = {len(self._leaves)} }};"
        switching = any(one.model.bind().program.inputs.switching for one in self.sets)
        bends = any(one.rows.across[k].has(TIME) for one in self.sets for k in one.form.across_sources)
        together = self._model.netlist.impacts == "together"
        torques = [name in StateTransfer(self.sets[0].form).through for name in StateTransfer(self.sets[0].form).names]
        yield f"enum {{ SWITCHES = {switching:d}, BENDS = {bends:d} }};"
        yield f"enum {{ TOGETHER = {together:d}, HAS_TORQUES = {any(torques):d} }};"
        yield _integers("MODES", [len(modes) for modes in options])
        yield _integers("FORM_STRIDE", strides)
        yield _integers("SET_OF", sets)
        yield _integers("FORM_OF", [forms[k].index(mode.form) if mode else 0 for _, k, mode in cells])
        yield array("const double", "NUMBER_OF", [repr(float(mode.value)) if mode else "0.0" for _, _, mode in cells])
        yield _integers("RIGID", [machine.is_rigid(mode.name) if mode else 0 for machine, _, mode in cells])
        sides = [machine.opening_side(mode.name) or 0.0 if mode else 0.0 for machine, _, mode in cells]
        yield array("const double", "OPENING", [*map(repr, map(float, sides))])
        exits = [[*(mode.gives_way if mode else ()), (0.0, ""), (0.0, "")][:2] for _, _, mode in cells]
        places = [self._place(k, to) for (_, k, _), pair in zip(cells, exits, strict=True) for _, to in pair]
        yield _integers("GIVES_WAY", places)
        yield array("const double", "WAY_SIDE", [repr(float(side)) for pair in exits for side, _ in pair])
        yield _integers("ONE_WAY", [machine.is_one_way for machine in machines])
        yield _integers("IS_SWITCH", [machine.is_switch for machine in machines])
        yield _integers("IS_TORQUE", torques)
        yield _integers("AT_REST", [k in one.resting for one in self._guards for k in range(len(machines))])
        yield from self._of_leaves()
        yield from self._of_states()

    def _of_leaves(self) -> Iterator[str]:
        rows = []
        for (k, name, _), leave in self._leaves.items():
            slope = leave.when.diff(INTEGRAL)
            flags_of = {
                "BY_TORQUE": leave.by_torque,
                "BY_TIME": leave.by_time,
                "BY_TWIST": leave.by_twist,
                "REBOUNDS": leave.rebound is not None,
                "BY_SPEED": leave.by_speed,
                "AS_IT_CLOSES": leave.when == ACROSS,
                "AS_IT_PULLS": leave.when == -THROUGH,
            }
            flags = " | ".join(flag for flag, holds in flags_of.items() if holds) or "0"
            twist = float(slope) if slope.is_number else 0.0
            rows.append(f"{{{k}, {self._place(k, name)}, {self._place(k, leave.to)}, {flags}, {twist!r}}}")
        yield array("const Leave", "LEAVES", rows)
        numbers = {key: number for number, key in enumerate(self._leaves)}
        watches, slices = list[str](), list[int]()
        for guards in self._guards:
            for k, machine in enumerate(self._machines):
                for n in range(self._most_modes):
                    slices.append(len(watches))
                    options = machine.modes.options
                    for active in guards.of(k, options[n].name) if n < len(options) else ():
                        leaf = numbers[k, options[n].name, options[n].leaves.index(active.leave)]
                        watches.append(f"{{{active.guard}, {int(active.side)}, {leaf}}}")
                    slices.append(len(watches))
        yield array("const Watch", "WATCHES", watches)
        yield _integers("WATCHED", slices)

    def _of_states(self) -> Iterator[str]:
        """Where speeds and twists are among the states, and how far rounding moves each."""
        states = [*dict.fromkeys(state.name for one in self.sets for state in one.form.states)]
        stores = StateTransfer(self.sets[0].form).names
        nominal = ChainMap(*(dict(one.nominal) for one in self.sets))
        moves = rounding_moves([nominal[name] for name in states])
        for name, column in (("MOVE_PART", 0), ("MOVE_LEAST", 1), ("MOVE_REACH", 3)):
            yield array("const double", name, [repr(float(move[column])) for move in moves])
        yield _integers("STORE_OF", [stores.index(name) if name in stores else -1 for name in states])
        yield _integers("HAS_INERTIA", [told for one in self.sets for told in self._has_inertia(one)])
        yield _integers("SPEEDS", [len(one.form.across_states) for one in self.sets])
        places, size = list[int](), max(len(states), 1)
        twists = list[int]()
        for one in self.sets:
            row = [states.index(state.name) for state in one.form.states[one.form.speeds]]
            places += [*row, *([0] * (size - len(row)))]
            for machine in self._machines:
                angles = [
                    s
                    for s in one.form.states
                    if s.kind == "integral" and one.form.graph.part_of(s.branch).name == machine.part.name
                ]
                twists.append(states.index(angles[0].name) if angles else -1)
        yield _integers("SPEED_PLACE", places)
        yield _integers("TWIST_PLACE", twists)

    @property
    def names(self) -> list[str]:
        """The function that names modes."""
        options = [machine.modes.options for machine in self._machines]
        firsts = [sum(map(len, options[:k])) for k in range(len(options))]
        words = [text_of(mode.words) for modes in options for mode in modes]
        return [_integers("FIRST_NAME", firsts), array("const char *const", "MODE_NAMES", words), _MODE_NAME]


_MODE_NAME = """const char *NAME_mode_name(int machine, int mode)
{
    const int told = machine >= 0 && machine < NM && mode >= 0 && mode < MODES[machine];
    return told ? MODE_NAMES[FIRST_NAME[machine] + mode] : "";
}
"""


def _strikes(machine: ModeMachine) -> bool:
    """Whether a machine becomes rigid by an impact; frictions pass a limited torque and no impulse."""
    return any(len(machine.modes[name].gives_way) < 2 for name in machine.rigid_modes)


def _integers(name: str, values: Sequence[int]) -> str:
    kind = "short" if all(abs(value) < 1 << 15 for value in values) else "int"
    return array(f"const {kind}", name, [str(int(value)) for value in values])
