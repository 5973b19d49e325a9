"""SPICE: networks as circuits that ngspice runs, and circuits of others as networks.

`deck` writes: `spice_elements` has an element for each branch, `smoothed_modes` a law in place of modes, `spice_laws`
expressions as ngspice reads them. `reader` reads: `netlist_lines` splits a text into lines, `devices` makes parts of
them, `waveforms` laws of sources, `lcapy_devices` what lcapy writes otherwise.
"""

from __future__ import annotations

from shaftwork.spice.netlist_reader import SpiceCircuit, read

__all__ = ["SpiceCircuit", "read"]
