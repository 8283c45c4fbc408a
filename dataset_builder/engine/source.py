"""Which of this package's own code turns a plan into bytes, and the digest of it.

That is everything that `engine.unit` imports, directly or indirectly. Code is compared as its syntax tree, without
docstrings, comments, and annotations of functions and variables: none of them changes a byte. Annotations in a class
count, since they declare the fields of dataclasses and what pydantic makes of a value.
"""

import ast
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from dataset_builder.digest import digest

ROOT = Path(__file__).parent.parent
UNIT = "engine.unit"
PASSES = "rendering.view_passes"
CALIBRATION = "engine.calibration"
"""What the figures of denoised layers come from, which their examples carry."""
FIELDS = "rendering.field_maker"
"""What fields come from, that examples may be seen through."""

UNTOLD = ("returns", "annotation", "type_comment", "type_params")
"""Fields of a syntax tree's nodes that only tell types."""


@cache
def source_digest(*roots: str) -> str:
    """Digest of the code that modules `roots` of this package run, so that examples of older code are not taken for
    current ones."""
    return digest_of(roots, read_sources())


def digest_of(roots: Iterable[str], sources: Mapping[str, str]) -> str:
    """Digest of the code of `roots` and of all that they import among `sources`."""
    return digest({name: _code(sources[name]) for name in sorted(closure(roots, sources))})


def read_sources(package: Path = ROOT) -> dict[str, str]:
    """Text of every module by dotted name without the package's, such as `spec.load`; a folder's is its `__init__`."""
    files = sorted(package.rglob("*.py"))
    names = [".".join(file.relative_to(package).with_suffix("").parts).removesuffix("__init__") for file in files]
    return {name.rstrip("."): file.read_text(encoding="utf-8") for name, file in zip(names, files, strict=True)}


def closure(roots: Iterable[str], sources: Mapping[str, str]) -> set[str]:
    """Names of `roots` and of all modules that they import, wherever in a function, with the folders they lie in.

    Not the package's own `__init__`: its version is recorded by itself, and the rest of it is a door to everything.
    """
    found, left = set[str](), list(roots)
    while left:
        name = left.pop()
        if name and name not in found:
            found.add(name)
            left += [name.rpartition(".")[0], *imported_by(name, sources)]
    return found


def imported_by(name: str, sources: Mapping[str, str]) -> set[str]:
    """Names of the modules of this package that a module imports at run time."""
    return {inner for one in imports_of(name, sources) if (inner := inside(one)) in sources and inner is not None}


def imports_of(name: str, sources: Mapping[str, str], *, typing: bool = False) -> set[str]:
    """Full names of all that a module imports, wherever in it; `from a import b` is a.b where that is a module.

    typing: with what stands under `if TYPE_CHECKING`, which never runs.
    """
    found = set[str]()
    for node in _imports(sources[name], typing):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        else:
            base = node.module or ""
            if node.level:
                folder = [ROOT.name, *name.split(".")][:-node.level]
                base = ".".join([*folder, *([base] if base else [])])
            found |= {whole if inside(whole := f"{base}.{alias.name}") in sources else base for alias in node.names}
    return found


@cache
def _tree(text: str) -> ast.Module:
    return ast.parse(text)


@cache
def _imports(text: str, typing: bool) -> tuple[ast.Import | ast.ImportFrom, ...]:
    """Of a module, once for all roots that import it; so is `_code`."""
    return tuple(node for node in _statements(_tree(text), typing) if isinstance(node, (ast.Import, ast.ImportFrom)))


@cache
def _code(text: str) -> str:
    return code(_tree(text))


def inside(name: str) -> str | None:
    """Name of a module within the package, or None for another's."""
    head, _, rest = name.partition(".")
    return rest if head == ROOT.name else None


def code(node: ast.AST, *, declares: bool = False) -> str:
    """What a tree does, as text that is the same for all versions of Python, which that of `ast.dump` is not.

    declares: whether the node stands in the body of a class, where annotations count.
    """
    if isinstance(node, ast.AnnAssign) and node.value and not declares:
        node = ast.Assign(targets=[node.target], value=node.value)
    told = declares and isinstance(node, ast.AnnAssign)
    fields = {name: _plain(value, declares=isinstance(node, ast.ClassDef) and name == "body")
              for name, value in ast.iter_fields(node) if told or name not in UNTOLD}
    text = ", ".join(f"{name}={value}" for name, value in fields.items() if value not in ("None", "[]"))
    return f"{type(node).__name__}({text})"


def _plain(value: Any, *, declares: bool) -> str:
    if isinstance(value, ast.AST):
        return code(value, declares=declares)
    if isinstance(value, list):
        parts = [_plain(item, declares=declares) for item in value if not _does_nothing(item, declares=declares)]
        return f"[{', '.join(parts)}]"
    return repr(value)


def _does_nothing(node: Any, *, declares: bool) -> bool:
    """Whether a statement is a docstring, of whatever stands above it, or tells types alone."""
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
    return _is_typing(node) or (isinstance(node, ast.AnnAssign) and node.value is None and not declares)


def _statements(node: ast.AST, typing: bool) -> Iterator[ast.AST]:
    """All below a node; expressions, most of a tree, have none inside."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.stmt, ast.ExceptHandler, ast.match_case)) and (typing or not _is_typing(child)):
            yield child
            yield from _statements(child, typing)


def _is_typing(node: Any) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"
