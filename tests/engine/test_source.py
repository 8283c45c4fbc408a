"""What makes an example another one: code that turns a plan into bytes, and nothing else in the package."""

import ast

import pytest

from dataset_builder.engine.source import CALIBRATION, UNIT, closure, code, digest_of, read_sources

SOURCES = read_sources()
ABOVE = ("cli", "report", "studies", "release", "lightnet", "api", "builder")
KNOWN = digest_of([UNIT], SOURCES)
CLOSURE = closure([UNIT], SOURCES)


def changed(name: str, edit: str) -> str:
    """Digest of the package with one edited module."""
    assert SOURCES[name] != edit
    return digest_of([UNIT], {**SOURCES, name: edit})


@pytest.mark.parametrize("name", sorted(SOURCES), ids=str)
def test_comments_docstrings_and_layout_are_no_code(name: str) -> None:
    tree = ast.parse(SOURCES[name])
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            node.value.value = "Something else."
    assert code(ast.parse(f"# A comment\n{ast.unparse(tree)}\n\n# Another\n")) == code(ast.parse(SOURCES[name]))


@pytest.mark.parametrize("name", [*sorted(SOURCES)[::12], "planning.cost", "shards.verify", "spec.load"])
def test_only_code_that_makes_bytes_counts(name: str) -> None:
    edited = changed(name, f"{SOURCES[name]}\nANOTHER = 1\n")
    assert (edited != KNOWN) == (name in CLOSURE)


def test_trainer_gate_cost_verification_reports_studies_and_commands_make_no_bytes() -> None:
    others = {"planning.cost", "shards.verify", "shards.verify_examples", "shards.card", "release.light_checks",
              "shards.reader", "engine.maker_file", "engine.outcomes", ""}
    assert others <= set(SOURCES)
    assert not others & CLOSURE and not {name for name in CLOSURE if name.startswith(ABOVE)}


@pytest.mark.parametrize("name", ["geometry.rough_base", "planning.view.cameras", "rendering.surface.lobes",
                                  "shards.exr", "seeding"])
def test_a_changed_constant_where_bytes_are_made_is_seen(name: str) -> None:
    tree = ast.parse(SOURCES[name])
    number = next(node for node in ast.walk(tree)
                  if isinstance(node, ast.Constant) and type(node.value) in (int, float))
    number.value += 1
    assert changed(name, ast.unparse(tree)) != KNOWN


def test_figures_of_denoised_layers_are_known_by_what_measures_them() -> None:
    edited = {**SOURCES, CALIBRATION: f"{SOURCES[CALIBRATION]}\nANOTHER = 1\n"}
    assert digest_of([UNIT], edited) == KNOWN
    assert digest_of([UNIT, CALIBRATION], edited) != digest_of([UNIT, CALIBRATION], SOURCES)


SMALL = {"a": "import dataset_builder.b\n", "b": "def f():\n    from dataset_builder.folder import c\n",
         "folder": "", "folder.c": "X = 1\n", "folder.d": "Y = 1\n", "": "from dataset_builder import folder"}


def test_what_is_imported_anywhere_counts_and_what_is_not_does_not() -> None:
    assert closure(["a"], SMALL) == {"a", "b", "folder", "folder.c"}
    assert digest_of(["a"], {**SMALL, "folder.d": "Y = 2\n"}) == digest_of(["a"], SMALL)


@pytest.mark.parametrize("how", ["from dataset_builder.folder import d", "import dataset_builder.folder.d",
                                 "from dataset_builder.folder.d import Y", "def g():\n    from .folder.d import Y",
                                 "try:\n    A = 1\nexcept OSError:\n    import dataset_builder.folder.d",
                                 "match 1:\n    case 1:\n        with f():\n            from .folder import d",
                                 "class C:\n    if f():\n        A = 1\n    else:\n        from .folder import d"])
def test_a_new_import_brings_a_module_in(how: str) -> None:
    wider = {**SMALL, "b": f"{SMALL['b']}{how}\n"}
    assert closure(["a"], wider) - closure(["a"], SMALL) == {"folder.d"}
    assert digest_of(["a"], {**wider, "folder.d": "Y = 2\n"}) != digest_of(["a"], wider)


def test_imports_for_types_alone_do_not_count() -> None:
    typed = {**SMALL, "a": f"{SMALL['a']}if TYPE_CHECKING:\n    from dataset_builder.folder import d\n"}
    assert digest_of(["a"], typed) == digest_of(["a"], SMALL)


@pytest.mark.parametrize(("one", "other"), [
    ("def f(x: int) -> int:\n    'Doc.'\n    return x", "def f(x):\n    return x  # c"),
    ("x: int = 1\n'''Doc.'''", "x = 1"), ("def f():\n    x: int\n    x = 1", "def f():\n    x = 1"),
    ("class A:\n    def f(self, x: int): return x", "class A:\n    'Doc.'\n    def f(self, x): return x"),
    ("x = (1 +\n     2)", "x = 1 + 2"), ('x = "a"', "x = 'a'"), ("'''Doc.'''", "")])
def test_the_same_code(one: str, other: str) -> None:
    assert code(ast.parse(one)) == code(ast.parse(other))


@pytest.mark.parametrize(("one", "other"), [
    ("x = 1", "x = 2"), ("x = 1", "x = 1.0"), ("x = 1", "x = True"), ("x = 'a'", "x = b'a'"), ("x = 1", "y = 1"),
    ("class A:\n    x: int", "class A:\n    x: float"), ("class A:\n    x: int = 1", "class A:\n    x = 1"),
    ("class A:\n    x: int", "class A: pass"), ("f(1)", "f(x=1)"), ("a - b", "a + b"), ("x = 'None'", "x = None"),
    ("@a\ndef f(): g()", "def f(): g()"), ("f(a, b)", "f(b, a)"), ("def f(x): g()", "def f(x=1): g()"),
    ("print('a')", "'a'"), ("return_ = [1]", "return_ = []"), ("x = ''", "x = '', ''")])
def test_other_code(one: str, other: str) -> None:
    assert code(ast.parse(one)) != code(ast.parse(other))
