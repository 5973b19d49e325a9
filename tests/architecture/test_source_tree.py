"""The rules of the house that a program can check, on every file under src/shaftwork."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import grimp
import networkx as nx
import pytest

import shaftwork as sw

SOURCE = Path(__file__).parents[2] / "src" / "shaftwork"
FILES = tuple(sorted(SOURCE.rglob("*.py")))
Function = ast.FunctionDef | ast.AsyncFunctionDef

RUNS_CODE = {"eval", "exec", "compile", "sympify", "parse_expr", "__import__"}
READS_CODE = {"pickle", "cPickle", "cloudpickle", "dill", "joblib", "marshal", "shelve"}
HEAVY = ("sympy", "scipy", "matplotlib", "heyoka", "numpy", "networkx", "pandas", "xarray", "sksundae", "pint")


@cache
def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"))


def place(file: Path, node: ast.AST) -> str:
    return f"{file.relative_to(SOURCE)}:{getattr(node, 'lineno', 1)}"


def functions() -> Iterator[tuple[str, int]]:
    """Every function's place and its length in lines, signature and docstring included."""
    for file in FILES:
        for node in ast.walk(tree(file)):
            if isinstance(node, Function) and node.end_lineno is not None:
                yield f"{place(file, node)} {node.name}", node.end_lineno - node.lineno + 1


def test_no_file_is_longer_than_400_lines() -> None:
    assert FILES
    lengths = {str(file.relative_to(SOURCE)): len(file.read_text(encoding="utf-8").splitlines()) for file in FILES}
    assert {name: length for name, length in lengths.items() if length > 400} == {}


def test_every_class_has_a_name_of_its_own() -> None:
    places: dict[str, list[str]] = {}
    for file in FILES:
        for node in ast.walk(tree(file)):
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, []).append(place(file, node))
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_95_percent_of_the_functions_have_at_most_40_lines() -> None:
    lengths = dict(functions())
    long = {name: length for name, length in lengths.items() if length > 40}
    assert len(long) <= 0.05 * len(lengths), long


def public_modules() -> tuple[Path, ...]:
    names = ((file, file.relative_to(SOURCE).with_suffix("").parts) for file in FILES)
    return tuple(file for file, parts in names if not any(re.match("_(?!_init__)", part) for part in parts))


def documented_methods(classes: dict[str, ast.ClassDef], name: str) -> set[str]:
    """Names of the methods that the class `name` or one of its bases in the package documents."""
    definition = classes.get(name)
    if definition is None:
        return set()
    own = {node.name for node in definition.body if isinstance(node, Function) and ast.get_docstring(node)}
    bases = (base.value if isinstance(base, ast.Subscript) else base for base in definition.bases)
    names = [base.attr if isinstance(base, ast.Attribute) else getattr(base, "id", "") for base in bases]
    return own.union(*(documented_methods(classes, base) for base in names))


def is_public(node: ast.stmt) -> bool:
    if not isinstance(node, Function | ast.ClassDef) or node.name.startswith("_"):
        return False
    decorators = {ast.unparse(decorator).rsplit(".", maxsplit=1)[-1] for decorator in node.decorator_list}
    return not decorators & {"overload", "setter"}


def undocumented() -> Iterator[str]:
    classes = {node.name: node for file in FILES for node in ast.walk(tree(file)) if isinstance(node, ast.ClassDef)}
    for file in public_modules():
        module = tree(file)
        if not ast.get_docstring(module):
            yield f"{place(file, module)} module"
        for node in filter(is_public, module.body):
            if not ast.get_docstring(node):
                yield f"{place(file, node)} {node.name}"
            if isinstance(node, ast.ClassDef):
                here = {made.name: made for made in ast.walk(module) if isinstance(made, ast.ClassDef)}
                known = documented_methods({**classes, **here}, node.name)
                for method in filter(is_public, node.body):
                    if not isinstance(method, ast.ClassDef) and method.name not in known:
                        yield f"{place(file, method)} {node.name}.{method.name}"


def test_every_public_name_has_a_docstring() -> None:
    assert list(undocumented()) == []


def runs_foreign_code(node: ast.AST) -> bool:
    match node:
        case ast.Call(
            func=ast.Attribute(attr="sympify"), keywords=[ast.keyword(arg="strict", value=ast.Constant(True))]
        ):
            return False  # reads no text
        case ast.Call(func=ast.Name(id=name)):
            return name in RUNS_CODE
        case ast.Call(func=ast.Attribute(value=owner, attr=name)):
            return name in RUNS_CODE and not (name == "compile" and not is_builtins(owner))
        case ast.Import(names=names):
            return any(alias.name.split(".")[0] in READS_CODE for alias in names)
        case ast.ImportFrom(module=str(module), names=names):
            return module.split(".")[0] in READS_CODE or any(alias.name in RUNS_CODE - {"compile"} for alias in names)
    return False


def is_builtins(owner: ast.expr) -> bool:
    return isinstance(owner, ast.Name) and owner.id == "builtins"


@pytest.mark.parametrize(
    "line",
    ["eval('1')", "sympy.sympify(text)", "from sympy import sympify", "import pickle", "builtins.compile(text)"],
)
def test_code_run_from_data_is_recognised(line: str) -> None:
    assert any(map(runs_foreign_code, ast.walk(ast.parse(line))))


@pytest.mark.slow
def test_no_line_runs_code_from_data() -> None:
    """But for the one place where equations become functions, whose code holds names of its own alone."""
    files = [file for file in FILES if file.name != "code.py"]
    assert [place(file, node) for file in files for node in ast.walk(tree(file)) if runs_foreign_code(node)] == []
    (generator,) = [file for file in FILES if file.name == "code.py"]
    assert sum(map(runs_foreign_code, ast.walk(tree(generator)))) == 2  # compile and exec of one line


def test_there_is_no_import_cycle() -> None:
    imports = grimp.build_graph("shaftwork", exclude_type_checking_imports=True, cache_dir=None)
    graph = nx.DiGraph(
        (module, imported)
        for module in imports.modules
        for imported in imports.find_modules_directly_imported_by(module)
    )
    assert graph.number_of_edges() > 0
    assert list(nx.simple_cycles(graph)) == []


@pytest.mark.slow
def test_no_module_imports_the_package_itself() -> None:
    """Inside the package, names come from the module that defines them, so that the import direction can be checked."""
    top = {path.stem for path in SOURCE.iterdir()}
    imports = [
        (place(file, node), alias.name)
        for file in FILES
        for node in ast.walk(tree(file))
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
        if (isinstance(node, ast.Import) and alias.name == "shaftwork")
        or (isinstance(node, ast.ImportFrom) and node.module == "shaftwork" and alias.name not in top)
    ]
    assert imports == []


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = f"import sys, shaftwork; print([name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_tests_and_benchmarks_name_nothing_that_the_package_lacks() -> None:
    """Also in annotations, which nobody evaluates."""
    root = SOURCE.parents[1]
    lacking = [
        f"{file.relative_to(root)}:{node.lineno} sw.{node.attr}"
        for folder in ("tests", "benchmarks")
        for file in sorted((root / folder).rglob("*.py"))
        for node in ast.walk(tree(file))
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) == "sw" and not hasattr(sw, node.attr)
    ]
    assert lacking == []
