"""Motions written to netCDF and Parquet, and read again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.core.errors import ModelFileError, ParameterError, imported
from shaftwork.core.files import drafted, in_a_folder
from shaftwork.motionfiles.record import ARRIVING, record_text
from shaftwork.pipeline.arguments import as_names
from shaftwork.results.data_frames import to_pandas, to_xarray
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.pipeline.motion_start import Repetition

RECORD = "shaftwork"
"""What a file says of the motion: a variable of netCDF, as attributes have at most 64 kB; an attribute of Parquet."""
SLASH, INSTEAD = "/", "\N{DIVISION SLASH}"
"""In names of netCDF a slash would begin a group."""
Columns = Mapping[str, Array]


def write_motion(call: Repetition, motion: Solution, path: Any, names: Sequence[str]) -> None:
    """Write a motion; see `Solution.save`."""
    place = in_a_folder(path)
    writer, _ = _format_of(place)
    wanted = dict.fromkeys((*motion.states, *(as_names(names) or (*motion.names, *motion.places))))
    text = record_text(motion, call)
    try:
        with drafted(place) as draft:
            writer(motion, tuple(wanted), text, draft)
    except OSError as error:
        raise ModelFileError(f"{place} cannot be written: {error}.") from None


def read_motion(place: Path) -> tuple[str, Array, Columns]:
    """What a file says of a motion, its output times (k,) in s, and its quantities at these by name.

    Raises:
        MissingExtraError: a library is not installed.
        ModelFileError: there is no such file, or it cannot be read.
        ParameterError: another end of the name.
    """
    _, reader = _format_of(place)
    if not place.is_file():
        raise ModelFileError(f"There is no file '{place}'.")
    try:
        return reader(place)
    except ImportError:
        raise
    except Exception as error:  # noqa: BLE001 (libraries of formats raise anything for a damaged file)
        raise ModelFileError(f"{place} cannot be read: {error}. Give a file that Solution.save wrote.") from None


def _write_netcdf(motion: Solution, names: Sequence[str], text: str, path: Path) -> None:
    imported("h5netcdf", "files", "Solution.save()")
    data = to_xarray(motion, names, {"title": motion.name, "engine": motion.engine, "why": motion.why})
    for name in data.variables:
        data[name].attrs["long_name"] = str(name)
    renamed = {name: str(name).replace(SLASH, INSTEAD) for name in data.variables if SLASH in str(name)}
    data = data.rename(renamed)
    for name, values in _arriving(motion):
        data[name] = ("t", values, {"long_name": name})
    data[RECORD] = ((), text, {"long_name": "what Shaftwork needs to make the motion again"})
    sums = {name: {"fletcher32": True} for name in data.variables if data[name].ndim}  # reading refuses flipped bits
    data.to_netcdf(path, engine="h5netcdf", encoding=sums)


def _arriving(motion: Solution) -> Iterator[tuple[str, Array]]:
    """What stands behind the states of a motion with travelling waves."""
    for number, values in enumerate(motion.x.T[len(motion.states) :]):
        yield f"{ARRIVING}{number:06d}", values


def _read_netcdf(path: Path) -> tuple[str, Array, Columns]:
    library = imported("xarray", "data", "load_solution()")
    imported("h5netcdf", "files", "load_solution()")
    data = library.load_dataset(path, engine="h5netcdf")
    text, t = str(data[RECORD].item()), data["t"].to_numpy()
    columns = {data[name].attrs["long_name"]: data[name].to_numpy() for name in data.data_vars if name != RECORD}
    return text, t, columns


def _write_parquet(motion: Solution, names: Sequence[str], text: str, path: Path) -> None:
    imported("pyarrow", "files", "Solution.save()")
    table = to_pandas(motion, names)
    along = {name: len(motion.places[name]) for name in names if motion[name].ndim > 1}
    units = {name: motion.reader.unit(name) for name in names}
    for name, values in _arriving(motion):
        table[name] = values
    table.attrs = {"title": motion.name, "units": units, "along": along, RECORD: text}
    table.to_parquet(path, engine="pyarrow", write_page_checksum=True)  # reading refuses flipped bits


def _read_parquet(path: Path) -> tuple[str, Array, Columns]:
    library = imported("pandas", "data", "load_solution()")
    imported("pyarrow", "files", "load_solution()")
    table = library.read_parquet(path, engine="pyarrow", page_checksum_verification=True)
    text, t = table.attrs[RECORD], table.index.to_numpy(dtype=float)
    return text, t, dict(_quantities(table, table.attrs["along"]))


def _quantities(table: Any, along: Mapping[str, int]) -> Iterator[tuple[str, Array]]:
    """Columns by quantity: one along a part is of several, "line.tau at 0.5 m"."""
    titles = iter(table.columns)
    for title in titles:
        name = title.rpartition(" at ")[0]
        if name in along and title not in along:
            rest = [next(titles) for _ in range(along[name] - 1)]
            yield name, np.column_stack([table[column].to_numpy(dtype=float) for column in (title, *rest)])
        else:
            yield title, table[title].to_numpy(dtype=float)


Writer = Callable[[Solution, Sequence[str], str, Path], None]
Loader = Callable[[Path], tuple[str, Array, Columns]]
FORMATS: Mapping[str, tuple[Writer, Loader]] = {
    ".nc": (_write_netcdf, _read_netcdf),
    ".h5": (_write_netcdf, _read_netcdf),
    ".hdf5": (_write_netcdf, _read_netcdf),
    ".parquet": (_write_parquet, _read_parquet),
}
"""By the end of a name, what writes and reads such files; netCDF 4 is HDF5."""


def _format_of(place: Path) -> tuple[Writer, Loader]:
    if place.suffix.lower() not in FORMATS:
        raise ParameterError(f"'{place.name}' has no end that is known. Take one of: {', '.join(FORMATS)}.")
    return FORMATS[place.suffix.lower()]
