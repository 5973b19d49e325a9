"""Small motions about a point as state-space systems of other libraries, and as tables.

    z' = A z + B v,  y = C z + D v

No such system holds an output that depends on the rate of an input, D1 of `LinearModel`: those are refused by name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import signal, sparse

from shaftwork.core.errors import ParameterError, SimulationError, imported
from shaftwork.core.files import in_a_folder, write_rows
from shaftwork.results.observer import Array

if TYPE_CHECKING:
    from shaftwork.frequency.linear_model import LinearModel

REPLACED = str.maketrans({".": ":", "[": "(", "]": ")"})
"""What python-control takes for a separator or an index, and what stands in its place."""


def control_names(names: Sequence[str], kind: str) -> list[str]:
    """Names as python-control admits them: "J2:omega" for "J2.omega", parentheses for brackets.

    Args:
        names: of states, inputs or outputs.
        kind: what they are, for the message.

    Raises:
        ParameterError: two names are the same then.
    """
    translated = [name.translate(REPLACED) for name in names]
    for place, name in enumerate(translated):
        if (first := translated.index(name)) != place:
            raise ParameterError(
                f"The {kind} '{names[first]}' and '{names[place]}' would both be '{name}' in python-control, which "
                "admits neither dots nor brackets. Rename a part, or take to_scipy(), which has no names."
            )
    return translated


def as_control(linear: LinearModel) -> Any:
    """A `control.StateSpace` with the names of states, inputs and outputs.

    Raises:
        MissingExtraError: python-control is not installed.
        ParameterError: two names are one in python-control.
        SimulationError: an output depends on the rate of an input.
    """
    control = imported("control", "control", "LinearModel.to_control()")
    matrices = _matrices(linear, "to_control()")
    return control.StateSpace(
        *matrices,
        0,
        states=control_names(linear.states, "states"),
        inputs=control_names(linear.inputs, "inputs"),
        outputs=control_names(linear.outputs, "outputs"),
        name=linear.title.translate(REPLACED),
    )


def as_scipy(linear: LinearModel) -> Any:
    """A `scipy.signal.StateSpace`, without names.

    Raises:
        SimulationError: an output depends on the rate of an input.
    """
    return signal.StateSpace(*_matrices(linear, "to_scipy()"))


def write_csv(linear: LinearModel, path: str | Path) -> None:
    """The matrices with their names: A, B, C, D in one table, or each in a file of its own.

    Args:
        linear: the model.
        path: a file, "linear.csv": states and outputs are rows, states and inputs columns. Or a folder, for A.csv,
            B.csv, C.csv and D.csv. D1 of the rates of inputs, "der(drive.omega)", is there where it is not zero.

    Raises:
        ParameterError: there is no folder for the file, or the folder's name is that of a file.
    """
    place = in_a_folder(path)
    rates = tuple(f"der({name})" for name in linear.inputs)
    blocks: dict[str, tuple[tuple[str, ...], tuple[str, ...], Array]] = {
        "A": (linear.states, linear.states, _full(linear.A)),
        "B": (linear.states, linear.inputs, linear.B),
        "C": (linear.outputs, linear.states, _full(linear.C)),
        "D": (linear.outputs, linear.inputs, linear.D),
    }
    if linear.D1.any():
        blocks["D1"] = (linear.outputs, rates, linear.D1)
    if place.suffix.lower() == ".csv":
        columns = (*linear.states, *linear.inputs, *(rates if "D1" in blocks else ()))
        motion, read = [_full(linear.A), linear.B], [_full(linear.C), linear.D]
        if "D1" in blocks:
            motion, read = [*motion, np.zeros((len(linear.states), len(rates)))], [*read, linear.D1]
        names = (*(f"der({name})" for name in linear.states), *linear.outputs)
        write_rows(place, ("", *columns), _rows(names, np.vstack([np.hstack(motion), np.hstack(read)])))
        return
    if place.is_file():
        raise ParameterError(f"path = '{place}' is a file. Name a folder for the matrices, or one table 'linear.csv'.")
    place.mkdir(exist_ok=True)
    for name, (rows, columns, matrix) in blocks.items():
        write_rows(place / f"{name}.csv", ("", *columns), _rows(rows, matrix))


def _rows(names: Iterable[str], matrix: Array) -> Iterator[tuple[object, ...]]:
    return ((name, *row) for name, row in zip(names, matrix.tolist(), strict=True))


def _matrices(linear: LinearModel, method: str) -> tuple[Array, Array, Array, Array]:
    """A, B, C and D.

    Raises:
        SimulationError: there is a D1.
    """
    if linear.D1.any():
        output, number = np.argwhere(linear.D1)[0]
        raise SimulationError(
            f"{method}: the output '{linear.outputs[output]}' of '{linear.title}' depends on the rate of the input "
            f"'{linear.inputs[number]}', as of a speed that is prescribed to an inertia, and A, B, C, D hold no rate "
            "of an input. Leave it out by linearize(outputs=..., inputs=...), drive the inertia through a spring or by "
            "a torque, or take frequency_response(), which has it."
        )
    return _full(linear.A), linear.B, _full(linear.C), linear.D


def _full(matrix: Any) -> Array:
    return np.asarray(matrix.toarray() if sparse.issparse(matrix) else matrix)
