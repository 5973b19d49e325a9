"""Live pages: an engineer moves sliders, and drawing, motion, extremes and frequencies follow at once.

A `Session` answers requests, as plain data; a server on this machine (`server`) or answers computed before
(`Session.page`) bring them to the page. The page is plain JavaScript and loads nothing from the internet.
"""

from __future__ import annotations

from shaftwork.live.server import serve, serving
from shaftwork.live.session import Session

__all__ = ["Session", "serve", "serving"]
