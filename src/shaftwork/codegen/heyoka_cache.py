"""Where heyoka keeps compiled code between processes."""

from __future__ import annotations

import heyoka

ROOM = 2**25
"""Bytes of compiled code that are kept, of the most recently used: opening it takes longer the more there is, 0.3 s of
each process for 1 GiB, which is more than most networks take to compile."""


def keep_apart() -> None:
    """Keep compiled code in a folder of our own beside heyoka's, or nowhere where no folder can be made."""
    state = heyoka.llvm_state
    path = state.get_diskcache_path()
    if path.name == "heyoka":  # nobody has said where
        try:
            state.set_diskcache_path(path.parent / "shaftwork")
            state.set_diskcache_limit(ROOM)  # opens the folder
        except RuntimeError:
            state.set_diskcache_enabled(False)
    elif not path.name:  # no home: it would be where the process is
        state.set_diskcache_enabled(False)
