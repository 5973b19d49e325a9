"""Settings of the whole test run."""

from __future__ import annotations

import os

# The matrices of the tests are small: threads that wait for each other would cost several times the work. This must be
# said before numpy is loaded.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
