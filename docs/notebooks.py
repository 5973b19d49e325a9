"""Notebooks in the built site, executed, with their outputs and figures.

mkdocs calls `on_files` and `on_page_markdown` (`hooks` in mkdocs.yml). With EXECUTE_NOTEBOOKS=false in the environment
the notebooks have no outputs, and the site is built in seconds: for `mkdocs serve` while one writes.
"""

from __future__ import annotations

import asyncio
import os
import re
from pathlib import Path
from typing import Any

import nbformat
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from nbclient import NotebookClient
from nbconvert import MarkdownExporter

NOTEBOOKS = Path(__file__).parents[1] / "notebooks"
SECONDS_PER_CELL = 300
LINK = re.compile(r"\]\(\.\./notebooks/([\w-]+)\.ipynb\)")
"""A link to a notebook, as it works in the repository."""
OTHER = re.compile(r"\]\(([\w-]+)\.ipynb\)")
"""A link from one notebook to another."""
STYLE = re.compile(r"<style scoped>.*?</style>", re.DOTALL)
"""What pandas puts before every table."""
ALIGNED = re.compile(r"^\\begin\{align\*\}.*?\\end\{align\*\}$", re.MULTILINE | re.DOTALL)
"""Equations that a cell shows, which Markdown takes for text unless they stand between dollars."""


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """The files of the site, with a page and the figures of every notebook.

    Raises:
        CellExecutionError: a cell raises an error.
    """
    paths = sorted(NOTEBOOKS.glob("*.ipynb"))
    notebooks = [nbformat.read(path, as_version=4) for path in paths]
    if config.extra["execute_notebooks"]:
        asyncio.run(_execute(notebooks))
    exporter = MarkdownExporter()
    for path, notebook in zip(paths, notebooks, strict=True):
        resources = {"output_files_dir": f"{path.stem}-figures", "unique_key": path.stem}
        page, resources = exporter.from_notebook_node(notebook, resources)
        page = ALIGNED.sub(r"\n$$\n\g<0>\n$$\n", OTHER.sub(r"](\1.md)", STYLE.sub("", page)))
        files.append(File.generated(config, f"notebooks/{path.stem}.md", content=page))
        for name, content in resources["outputs"].items():
            files.append(File.generated(config, f"notebooks/{name}", content=content))
    return files


async def _execute(notebooks: list[nbformat.NotebookNode]) -> None:
    """Execute notebooks in place, as many at a time as there are processors."""
    free = asyncio.Semaphore(os.cpu_count() or 1)

    async def execute(notebook: nbformat.NotebookNode) -> None:
        async with free:
            resources = {"metadata": {"path": str(NOTEBOOKS)}}
            client = NotebookClient(notebook, timeout=SECONDS_PER_CELL, coalesce_streams=True, resources=resources)
            await client.async_execute()

    await asyncio.gather(*(execute(notebook) for notebook in notebooks))


def on_page_markdown(markdown: str, **_: Any) -> str:
    """The text of a page with its links to notebooks leading to their pages."""
    return LINK.sub(r"](notebooks/\1.md)", markdown)
