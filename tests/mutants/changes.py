"""The small changes that can be made to a module's source, one at a time."""

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass

COMPARED: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.GtE),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.LtE),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Add,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
NAMES = {"min": "max", "max": "min", "any": "all", "all": "any", "minimum": "maximum", "maximum": "minimum"}
DECLARING = ("knob", "Knob", "ParamSpec", "TypeVar", "njit", "slice_of", "Field")
"""Calls (by the ends of their names) whose numbers are choices, not computation."""
NOTES = ("progress", "report", "warn", "info", "debug", "warning")
"""Calls that tell somebody something: that one is missing changes no result."""


@dataclass(frozen=True, order=True)
class Change:
    """Of one place in a file. before, after : the changed part, as it stands and as it becomes. end : its last line,
    and the column after it. statement : whether it is a whole one.
    """

    file: str
    line: int
    column: int
    before: str
    after: str
    end: tuple[int, int]
    statement: bool

    @property
    def words(self) -> str:
        return f"{self.before} -> {self.after}"

    def applied(self, source: str) -> str:
        lines = source.split("\n")
        first, last = lines[self.line - 1].encode(), lines[self.end[0] - 1].encode()
        # Brackets, since what stands on several lines may do so only within some.
        inside = self.after if self.statement or self.line == self.end[0] else f"({self.after})"
        changed = first[: self.column].decode() + inside + last[self.end[1] :].decode()
        return "\n".join([*lines[: self.line - 1], changed, *lines[self.end[0] :]])


def changes(file: str, source: str) -> list[Change]:
    """All of them, in the order of the source."""
    tree = ast.parse(source)
    return sorted({_change(file, source, node, made) for node, made in _forms(tree)})


def _change(file: str, source: str, node: ast.AST, made: str) -> Change:
    assert isinstance(node, ast.expr | ast.stmt)
    assert node.end_lineno is not None
    assert node.end_col_offset is not None
    before = " ".join((ast.get_source_segment(source, node) or "").split())
    end = (node.end_lineno, node.end_col_offset)
    return Change(file, node.lineno, node.col_offset, before, made, end, isinstance(node, ast.stmt))


def _forms(node: ast.AST) -> Iterator[tuple[ast.AST, str]]:
    """Below a node, each part that can be changed and the source of what it becomes."""
    if isinstance(node, ast.Import | ast.ImportFrom | ast.Raise | ast.Assert | ast.JoinedStr):
        return
    if isinstance(node, ast.Call) and _called(node).endswith(DECLARING):
        return
    if isinstance(node, ast.keyword) and node.arg == "strict":
        return  # of zips whose sides are as long
    yield from ((node, made) for made in _made(node))
    for name, value in ast.iter_fields(node):
        if name in ("decorator_list", "annotation", "returns", "type_params"):
            continue
        parts = value if isinstance(value, list) else [value]
        for part in parts:
            if isinstance(part, ast.AST):
                yield from _forms(part)


def _called(call: ast.Call) -> str:
    return ast.unparse(call.func).rpartition(".")[2]


def _made(node: ast.AST) -> Iterator[str]:
    changed = copy.deepcopy(node)
    if isinstance(node, ast.Compare) and isinstance(changed, ast.Compare) and len(node.ops) == 1:
        for other in COMPARED[type(node.ops[0])]:
            changed.ops = [other()]
            yield ast.unparse(changed)
    elif isinstance(node, ast.BinOp) and isinstance(changed, ast.BinOp) and type(node.op) in COMPUTED:
        if not _of_text_or_types(node):
            changed.op = COMPUTED[type(node.op)]()
            yield ast.unparse(changed) if isinstance(node.op, ast.Pow) else f"({ast.unparse(changed)})"
    elif isinstance(node, ast.AugAssign) and isinstance(changed, ast.AugAssign) and type(node.op) in COMPUTED:
        changed.op = COMPUTED[type(node.op)]()
        yield ast.unparse(changed)
    elif isinstance(node, ast.BoolOp) and isinstance(changed, ast.BoolOp):
        changed.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield f"({ast.unparse(changed)})"
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        yield ast.unparse(node.operand) if isinstance(node.op, ast.Not) else f"({ast.unparse(node.operand)})"
    elif isinstance(node, ast.Constant):
        yield from _numbers(node.value)
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        if _called(node.value) not in NOTES:
            yield "pass"
    elif isinstance(node, ast.Call) and _called(node) in NAMES and isinstance(changed, ast.Call):
        other = NAMES[_called(node)]
        if isinstance(changed.func, ast.Name):
            changed.func.id = other
        elif isinstance(changed.func, ast.Attribute):
            changed.func.attr = other
        yield ast.unparse(changed)
    elif isinstance(node, ast.Break | ast.Continue):
        yield "continue" if isinstance(node, ast.Break) else "break"


def _numbers(value: object) -> Iterator[str]:
    if isinstance(value, bool):
        yield str(not value)
    elif isinstance(value, int):
        yield str(value + 1)
    elif isinstance(value, float):
        yield repr(value * 1.5) if value else "1.0"


def _of_text_or_types(node: ast.BinOp) -> bool:
    """Whether something is put together out of texts, or a union of types."""
    return any(
        isinstance(part, ast.JoinedStr)
        or (isinstance(part, ast.Constant) and (isinstance(part.value, str | bytes) or part.value is None))
        for part in ast.walk(node)
    )
