"""Settings of the whole test run."""

from __future__ import annotations

import importlib.util
import os
import signal

import pytest
from hypothesis import HealthCheck, settings

# The matrices of the tests are small: threads that wait for each other would cost several times the work. This must be
# said before numpy is loaded.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

# Who runs the tests in the background of a script ignores Ctrl-C, and so would they and the commands that they start.
signal.signal(signal.SIGINT, signal.default_int_handler)

if importlib.util.find_spec("heyoka") is not None:
    import heyoka

    # Thousands of random networks are compiled once each: they are not worth keeping, on disk or in memory.
    heyoka.llvm_state.set_diskcache_enabled(False)
    heyoka.llvm_state.set_memcache_limit(2**28)

# A property is tried on 20 examples or on SHAFTWORK_EXAMPLES, an expensive one on its share (`share_of_examples`).
# They are the same in every run: a red test must mean a change of the code, not of the dice.
settings.register_profile(
    "random networks",
    max_examples=int(os.environ.get("SHAFTWORK_EXAMPLES", "20")),
    deadline=None,
    database=None,
    derandomize=True,
    suppress_health_check=[
        HealthCheck.too_slow,
        HealthCheck.data_too_large,
        HealthCheck.large_base_example,
        HealthCheck.filter_too_much,
    ],
)
settings.load_profile("random networks")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Random networks run without the coverage tool: it would double their time, and other tests reach every line.

    What says something of an engine that is not installed is skipped: by a parameter, or by the mark of heyoka.
    """
    from shaftwork.integrate.engines import ENGINES

    missing = {name for name, entry in ENGINES.items() if not entry.installed}
    for item in items:
        if getattr(getattr(item, "function", None), "is_hypothesis_test", False):
            item.add_marker("no_cover")
        parameters = map(str, getattr(getattr(item, "callspec", None), "params", {}).values())
        marks = (mark.name for mark in item.iter_markers())
        for engine in missing.intersection((*parameters, *marks)):
            item.add_marker(pytest.mark.skip(reason=f"the engine {engine} is not installed"))
