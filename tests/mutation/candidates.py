"""The small faults that can be put into a source file, each as a replacement of bytes."""

from __future__ import annotations

import ast
import copy
from dataclasses import dataclass
from itertools import accumulate

COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
}
SIGNS: dict[type[ast.operator], type[ast.operator]] = {ast.Add: ast.Sub, ast.Sub: ast.Add}
WORDS: dict[type[ast.boolop], type[ast.boolop]] = {ast.And: ast.Or, ast.Or: ast.And}

UNTOUCHED_ARGUMENTS = {"strict", "stacklevel"}  # guards against what cannot happen, and where a warning points
TEXT_CALLS = {"warn"}


@dataclass(frozen=True)
class Candidate:
    """One fault: bytes `start` to `end` of the file become `text`."""

    line: int
    kind: str
    start: int
    end: int
    text: str

    def applied(self, source: bytes) -> bytes:
        """The file with this fault."""
        return source[: self.start] + self.text.encode() + source[self.end :]


def candidates(source: bytes) -> tuple[Candidate, ...]:
    """Every fault that this file can have, in order of place."""
    finder = _Finder(source)
    finder.visit(ast.parse(source))
    return tuple(sorted(finder.candidates, key=lambda one: (one.start, one.kind)))


class _Finder(ast.NodeVisitor):
    """Walks what is executed: no annotations, decorators, docstrings, f-strings or texts of errors and warnings."""

    def __init__(self, source: bytes) -> None:
        self.line_starts = (0, *accumulate(len(line) for line in source.splitlines(keepends=True)))
        self.candidates: list[Candidate] = []
        self.rebound: list[set[str]] = [set()]

    def add(self, kind: str, old: ast.expr | ast.stmt, new: str) -> None:
        start = self.line_starts[old.lineno - 1] + old.col_offset
        end = self.line_starts[(old.end_lineno or old.lineno) - 1] + (old.end_col_offset or 0)
        self.candidates.append(Candidate(old.lineno, kind, start, end, new))

    def replace(self, kind: str, old: ast.expr, **fields: object) -> None:
        new = copy.copy(old)
        for name, value in fields.items():
            setattr(new, name, value)
        self.add(kind, old, f"({ast.unparse(new)})")

    def visit_Compare(self, node: ast.Compare) -> None:
        for place, operator in enumerate(node.ops):
            ops = [*node.ops[:place], COMPARISONS[type(operator)](), *node.ops[place + 1 :]]
            self.replace("comparison", node, ops=ops)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        if type(node.op) in SIGNS and not isinstance(node.left, ast.JoinedStr) and not _is_text(node.right):
            self.replace("sign", node, op=SIGNS[type(node.op)]())
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.USub):
            self.add("sign", node, f"({ast.unparse(node.operand)})")
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        self.replace("and/or", node, op=WORDS[type(node.op)]())
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        match node.value:
            case bool():
                self.add("true/false", node, repr(not node.value))
            case int():
                self.add("constant", node, repr(node.value + 1))
            case float() if node.value:
                self.add("constant", node, repr(node.value * 1.01))
            case float():
                self.add("constant", node, "0.01")

    def visit_Slice(self, node: ast.Slice) -> None:
        for bound in (node.lower, node.upper):
            if bound is not None and not isinstance(bound, ast.Constant):
                self.add("slice", bound, f"({ast.unparse(bound)}) + 1")
        self.generic_visit(node)

    def visit_Subscript(self, node: ast.Subscript) -> None:
        if isinstance(node.slice, ast.BinOp):
            self.add("slice", node.slice, f"({ast.unparse(node.slice)}) + 1")
        self.generic_visit(node)

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self.add("dropped", node, "pass")
        if not isinstance(node.value, ast.Constant):  # a docstring
            self.generic_visit(node)

    def visit_Raise(self, node: ast.Raise) -> None:
        self.add("dropped", node, "pass")  # and nothing inside: an error's text

    def visit_Assign(self, node: ast.Assign) -> None:
        if all(self.is_bound_without(target) for target in node.targets):
            self.add("dropped", node, "pass")
        self.visit(node.value)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.add("dropped", node, "pass")
        self.visit(node.value)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def is_bound_without(self, target: ast.expr) -> bool:
        """Whether what this assigns to exists without it, so that leaving it out is no mere NameError."""
        if isinstance(target, ast.Tuple):
            return all(map(self.is_bound_without, target.elts))
        return not isinstance(target, ast.Name) or target.id in self.rebound[-1]

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        self.rebound.append(_bound_twice(node))
        for default in (*node.args.defaults, *node.args.kw_defaults):
            if default is not None:
                self.visit(default)
        for statement in node.body:
            self.visit(statement)
        self.rebound.pop()

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for statement in node.body:
            self.visit(statement)

    def visit_If(self, node: ast.If) -> None:
        if ast.unparse(node.test) != "TYPE_CHECKING":
            self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        if name not in TEXT_CALLS:
            self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:
        if node.arg not in UNTOUCHED_ARGUMENTS:
            self.visit(node.value)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """A text: nothing in it is changed."""


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _bound_twice(function: ast.FunctionDef) -> set[str]:
    """Names that are arguments, or assigned at more than one place."""
    arguments = [argument.arg for argument in ast.walk(function.args) if isinstance(argument, ast.arg)]
    stored = [node.id for node in ast.walk(function) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    return {name for name in stored if (arguments + stored).count(name) > 1}
