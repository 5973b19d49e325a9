"""The command `shaftwork`: a module for each of its commands, and what they share."""

from __future__ import annotations

from shaftwork.cli.program import DONE, FAILED, INTERRUPTED, WRONG_INPUT, main

__all__ = ["DONE", "FAILED", "INTERRUPTED", "WRONG_INPUT", "main"]
