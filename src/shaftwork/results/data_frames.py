"""Quantities of a motion as tables of pandas and data sets of xarray."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Protocol

from shaftwork.core.errors import imported
from shaftwork.results.observer import Array, Reader

if TYPE_CHECKING:
    import pandas as pd
    import xarray


class Readable(Protocol):
    """A motion as tables need it; one that is stored is made again only for what is not."""

    @property
    def t(self) -> Array:
        """(k,) output times, s."""
        ...

    @property
    def places(self) -> Mapping[str, Array]:
        """Of quantities along a part, m."""
        ...

    @property
    def reader(self) -> Reader:
        """Knows the units."""
        ...

    def __getitem__(self, name: str) -> Array:
        """A quantity at the output times."""
        ...


def to_pandas(motion: Readable, names: Iterable[str]) -> pd.DataFrame:
    """A table over time of quantities; see `Solution.to_pandas`."""
    frame = imported("pandas", "data", "Solution.to_pandas()")
    columns = {title: column for name in names for title, column in _columns(motion, name)}
    return frame.DataFrame(columns, index=frame.Index(motion.t, name="t"))


def _columns(motion: Readable, name: str) -> Iterator[tuple[str, Array]]:
    """A quantity in columns (k,) with their titles."""
    values = motion[name]
    if values.ndim == 1:
        yield name, values
    else:
        yield from zip((f"{name} at {place:g} m" for place in motion.places[name]), values.T, strict=True)


def to_xarray(motion: Readable, names: Iterable[str], attributes: Mapping[str, str]) -> xarray.Dataset:
    """A data set over time of quantities; see `Solution.to_xarray`."""
    library = imported("xarray", "data", "Solution.to_xarray()")
    coords = {"t": ("t", motion.t, {"units": "s"})}
    data = {}
    for name in names:
        values, along = motion[name], f"{name}.x"
        if values.ndim > 1:
            coords[along] = (along, motion.places[name], {"units": "m"})
        data[name] = (("t", along)[: values.ndim], values, {"units": motion.reader.unit(name)})
    return library.Dataset(data, coords=coords, attrs=attributes)  # type: ignore[no-any-return]
