"""Settings of the whole test run."""

from __future__ import annotations

import importlib.util
import os

# The matrices of the tests are small: threads that wait for each other would cost several times the work. This must be
# said before numpy is loaded.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

if importlib.util.find_spec("heyoka") is not None:
    import heyoka

    # Thousands of random networks are compiled once each: they are not worth keeping, on disk or in memory.
    heyoka.llvm_state.set_diskcache_enabled(False)
    heyoka.llvm_state.set_memcache_limit(2**28)
