"""The order of the house: imports only go down, each outside library has one home, and nothing goes in circles."""

import ast
from collections import Counter
from graphlib import CycleError, TopologicalSorter

import pytest

from dataset_builder.engine.source import imports_of, inside, read_sources

ORDER = (
    ("__main__",), ("cli.main",), ("cli",), ("cli.common",), ("report",),
    ("report.gallery", "report.looking"), ("report.front",),
    ("studies.accuracy", "studies.budget", "studies.effects", "studies.noise", "studies.stress", "studies.tables"),
    ("studies",),
    ("release",), ("exporting", "importing", "transfer"), ("exporting.formats", "importing.captures"),
    ("lightnet.results", "lightnet.training"), ("lightnet.methods",), ("lightnet.measures",), ("lightnet.data",),
    ("lightnet",),
    ("api", "merge"), ("builder",), ("engine",), ("shards",),
    ("rendering",), ("rendering.field", "rendering.sampling", "rendering.scene"), ("rendering.transport",),
    ("rendering.surface",),
    ("rendering.backend", "rendering.buffers", "rendering.oidn"),
    ("planning",), ("planning.effects",), ("planning.view",), ("planning.scene",),
    ("planning.catalogue",),
    ("assets.procedural", "assets.scene_file"), ("assets.scene_readers",), ("assets",),
    ("assets.pose_readers", "assets.readers"),
    ("assets.field_file", "assets.file_model", "assets.image_maps", "assets.scene_model"),
    ("assets.exr_picture",), ("assets.asset", "assets.linear_texels", "assets.primaries", "assets.texel_memory"),
    ("geometry",), ("label",), ("spec",),
    ("remote",), ("byte_store", "lock"), ("lease",),
    ("extras", "files", "layers", "light_kinds", "processes", "spread", "tonemap"),
    ("seeding", "digest", "errors"), ("",),
)
"""Rooms of the package, top to bottom; those of one line do not know each other. A module belongs to the longest name
that it begins with; a name stands for what is left of its folder. "" is the package itself."""

STRANGERS = {("lightnet", "api"), ("lightnet", "builder"), ("lightnet", "engine"), ("lightnet", "rendering"),
             ("shards", "rendering"), ("shards", "planning")}
"""Stages that do not know what stands below them, either."""

HOMES = {
    "mitsuba": "rendering", "drjit": "rendering", "ruamel": "spec.load", "open3d": "geometry",
    "OpenEXR": ("shards.exr", "assets.exr_picture", "exporting.formats.layered_exr"),
    "pyarrow": "exporting.formats.parquet_rows",
    "fsspec": "remote", "huggingface_hub": "transfer",
    "matplotlib": "report", "pyvista": "report.looking", "vtkmodules": "report.looking", "jinja2": "report.front",
    "mapbox_earcut": "assets.readers.polygons", "ray": "engine",
    "DracoPy": "assets.readers.gltf_primitives", "meshopt": "assets.readers.gltf_file",
    "opengl_basisu": "assets.readers.gltf_images",
    "torch": ("lightnet", "release"), "tensorboard": "lightnet.training",
    "skimage": ("lightnet.results", "geometry.marching", "rendering.field.field_figures"),
    "flip_evaluator": "studies.image_errors", "pyoidn": "rendering.oidn",
    "pxr": ("assets.readers", "assets.scene_readers", "exporting", "spec.usd_references", "spec.usd_trial"),
}
"""The only folder or module that may import a library."""

Sources = dict[str, str]


def room(name: str) -> str | None:
    """Entry of the order that a module belongs to."""
    named = [entry for line in ORDER for entry in line if name == entry or (entry and name.startswith(f"{entry}."))]
    return max(named, key=len, default=None)


def rank(name: str) -> int | None:
    """Line of the order that a module stands on, from the top."""
    return next((line for line, names in enumerate(ORDER) if room(name) in names), None)


def broken_rules(modules: Sources) -> list[str]:
    """Every import that goes up, sideways, to a library's wrong user, or round in a circle."""
    rules, graph = [], {}
    for name in modules:
        if rank(name) is None:
            rules.append(f"{name}: stands nowhere in the order")
        # The package's own `__init__` names what it offers for type checkers, and imports none of it
        imported = imports_of(name, modules, typing=bool(name))
        inner = {target for one in imported if (target := inside(one)) is not None}
        graph[name] = inner - {name}
        rules += [f"{name} imports {target}: not below it" for target in sorted(inner) if not may_import(name, target)]
        libraries = sorted({one.split(".")[0] for one in imported} & set(HOMES))
        rules += [f"{name} imports {library}: belongs to {HOMES[library]}" for library in libraries
                  if not any(f"{name}.".startswith(f"{home}.") for home in homes_of(library))]
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        rules.append("circle: " + " -> ".join(error.args[1]))
    return rules


def homes_of(library: str) -> tuple[str, ...]:
    """Where a library may be imported."""
    home = HOMES[library]
    return (home,) if isinstance(home, str) else home


def may_import(name: str, target: str) -> bool:
    """Whether `target` is in the room of `name` or on a line below, and no stranger to it."""
    if (name.split(".")[0], target.split(".")[0]) in STRANGERS:
        return False
    above, below = rank(name), rank(target)
    return room(name) == room(target) or (above is not None and below is not None and above < below)


def test_the_package_keeps_the_order() -> None:
    modules = read_sources()
    assert len(modules) > 20
    rules = broken_rules(modules)
    assert rules == []


def test_every_room_is_in_the_order() -> None:
    """A sub-folder that is not would count as its stage's, and its neighbours could import it."""
    rooms = {".".join(name.split(".")[:2]) for name in read_sources() if name.count(".") > 1}
    assert rooms <= {name for names in ORDER for name in names}


@pytest.mark.parametrize(("modules", "rule"), [
    ({"spec.a": "from dataset_builder.planning import plan", "planning.plan": ""},
     "spec.a imports planning.plan: not below it"),
    ({"spec.a": "import dataset_builder.planning.plan", "planning.plan": ""},
     "spec.a imports planning.plan: not below it"),
    ({"spec.a": "def f():\n    from ..planning.plan import x", "planning.plan": ""},
     "spec.a imports planning.plan: not below it"),
    ({"digest": "from dataset_builder.errors import UserError", "errors": ""}, "digest imports errors: not below it"),
    ({"helpers": ""}, "helpers: stands nowhere in the order"),
    ({"planning.a": "import mitsuba as mi"}, "planning.a imports mitsuba: belongs to rendering"),
    ({"spec.check": "from ruamel.yaml import YAML"}, "spec.check imports ruamel: belongs to spec.load"),
    ({"spec.loader": "from ruamel.yaml import YAML"}, "spec.loader imports ruamel: belongs to spec.load"),
    ({"geometry.a": "from . import b", "geometry.b": "from .a import x"},
     "circle: geometry.b -> geometry.a -> geometry.b"),
])
def test_the_checker_sees(modules: Sources, rule: str) -> None:
    rules = broken_rules(modules)
    assert len(rules) == 1
    assert rules[0] == rule or (rule.startswith("circle") and rules[0].startswith("circle"))


def test_the_checker_allows() -> None:
    modules = {"cli": "from dataset_builder import __version__\nfrom dataset_builder.spec import load\nimport numpy",
               "spec.load": "from ruamel.yaml import YAML\nfrom dataset_builder.spec.model import Model\nimport rays",
               "spec.model": "from ..errors import UserError", "errors": "", "": "",
               "rendering.a": "import drjit as dr"}
    assert broken_rules(modules) == []


def test_files_stay_short() -> None:
    long = {name: count for name, source in read_sources().items() if (count := len(source.splitlines())) > 250}
    assert not long


def test_a_name_means_one_thing() -> None:
    """Files and public classes have names of their own; a verb's file is called as what it calls."""
    sources = read_sources()
    stems = Counter(name.rpartition(".")[2] for name in sources if name and not name.startswith("cli."))
    folders = {name for name in sources for other in sources if other.startswith(f"{name}.")}
    classes = Counter(node.name for source in sources.values() for node in ast.parse(source).body
                      if isinstance(node, ast.ClassDef) and not node.name.startswith("_"))
    assert not [name for name, count in (stems - Counter(f.rpartition(".")[2] for f in folders)).items() if count > 1]
    assert not [name for name, count in classes.items() if count > 1]
