"""What the pages say is true of the code: blocks run, links lead somewhere, names exist, tables are in step."""

import argparse
import json
import re
import shlex
import shutil
import subprocess
from dataclasses import fields
from pathlib import Path

import pytest
from ruamel.yaml import YAML

import dataset_builder
from dataset_builder.assets.asset import Material
from dataset_builder.cli.main import main, parser
from dataset_builder.layers import LAYERS, PAPER_LAYERS
from dataset_builder.lightnet.measures.metrics import METRICS
from dataset_builder.shards import gates
from dataset_builder.shards.identities import identity_table
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.load import load_dataset
from dataset_builder.spec.mesh_source import MESH_SUFFIXES
from dataset_builder.spec.scene import ObjectSpec, RoomSpec
from tests.docs_site import write_flat, write_houses, write_models, write_photographs, write_splats, write_teapot
from tools import spec_tables

ROOT = Path(__file__).parent.parent
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
OTHERS = [ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
MINI, TURNING, SEEN = "3df-lighting-mini", "3df-lighting-360", "3df-lighting-field-mini"
CHEAP = ("--set", "image={width: 24, height: 24}", "--set", "render.spp=4", "--set", "render.max_depth=3",
         "--set", "rough.edge_length=0.2", "--set", "gates.mask_overlap=0.1", "--set", "splits.train.pairs=1",
         "--set", "splits.train.views=1", "--workers", "1", "--backend", "llvm")
CHEAP_MINI = (*CHEAP, "--set", "splits.evaluation.pairs=1", "--set", "splits.evaluation.views=1")
"""Added to every build that a page shows, so that it takes seconds; later values win."""
CHEAP_TURNING = (*CHEAP, "--set", "splits.turn.pairs=1", "--set", "splits.turn.views=8", "--set",
                 "splits.turn.source={kind: mesh}")
TINY_TRAINING = ("--set", "steps=2", "--set", "model={width: 4, downs: 2}", "--set",
                 "data={crop: 16, batch: 1, workers: 0}", "--device", "cpu")
PLAIN_TOOLS = ("cp", "diff")
FEW_BYTES = 1_500_000
OWN_SPECS = ("own-meshes", "scenes")
"""Pages whose specs are whole files, with files of their own."""


def blocks(page: Path, language: str) -> list[str]:
    """Fenced blocks of one language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def prose(page: Path) -> str:
    """A page without its fenced blocks."""
    return re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def inline(page: Path) -> list[str]:
    """What stands between backticks in running text."""
    return re.findall(r"`([^`\n]+)`", prose(page))


def verbs() -> dict[str, argparse.ArgumentParser]:
    """Parsers of the command's verbs."""
    return subcommands(parser())


def subcommands(of: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    """Parsers of what comes next on a command line."""
    return next(action.choices for action in of._actions if isinstance(action, argparse._SubParsersAction))


def options_of(verb: argparse.ArgumentParser) -> set[str]:
    """Options of a parser and of all verbs below it."""
    found = {option for action in verb._actions for option in action.option_strings}
    below = [action.choices for action in verb._actions if isinstance(action, argparse._SubParsersAction)]
    return found.union(*(options_of(one) for choices in below for one in choices.values()))


def cheap(arguments: list[str]) -> list[str]:
    """A command as the pages show it, made to take seconds."""
    if arguments[0] == "plan":
        return [*arguments, "--views", "2"]
    if arguments[0] == "view":
        return [*arguments, "--no-preview"]
    if arguments[:2] == ["study", "noise"]:
        tiny = [text if text != "--set" else "--train-set" for text in TINY_TRAINING]
        return [*arguments, *CHEAP_MINI, "--levels", "0,0.01", *tiny, "--steps", "2", "--per-level-steps", "1"]
    if arguments[:2] == ["study", "budget"]:
        tiny = [text if text != "--set" else "--train-set" for text in TINY_TRAINING]
        return [*arguments, *CHEAP_MINI, *tiny, "--spp", "4,16", "--least", "2", "--held-out", "2", "--seeds", "1",
                "--steps", "2", "--raw-only"]
    if arguments[0] == "study":
        return [*arguments, "--set", "image={width: 24, height: 24}", "--set", "rough.edge_length=0.2", "--backend",
                "llvm"]
    if arguments[0] == "train":
        return [*arguments, *TINY_TRAINING]
    if arguments[0] == "table":
        return [*arguments, *TINY_TRAINING, "--steps", "2"]
    if arguments[:3] == ["import", "capture", "splats/vase.ply"]:
        return [*arguments, "--resolution", "16", "--backend", "llvm"]
    if arguments[:2] == ["import", "capture"]:
        return [*arguments, "--size", "48", "--resolution", "32", "--steps", "40", "--backend", "llvm", "--no-sheet"]
    if arguments[0] == "import":
        return [*arguments, "--no-sheet"]
    if arguments[0] == "merge":
        return [*arguments, *CHEAP_MINI[:CHEAP_MINI.index("--workers")], *CHEAP_MINI[len(CHEAP):]]
    if arguments[0] == "build":
        return [*arguments, *(CHEAP_MINI if MINI in arguments[1] else CHEAP_TURNING if TURNING in arguments[1] else
                              CHEAP)]
    return arguments


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder like the repository after `make dataset`, with a mini dataset of two examples."""
    site = tmp_path_factory.mktemp("site")
    shutil.copytree(ROOT / "scene_specs", site / "scene_specs")
    spec, out = site / "scene_specs" / f"{MINI}.yaml", site / "datasets" / MINI
    assert main(["build", str(spec), "--out", str(out), *CHEAP_MINI]) == 0
    pages = ROOT / "docs"
    write_teapot(site, blocks(pages / "own-meshes.md", "yaml"))
    write_flat(site / "house", blocks(pages / "scenes.md", "yaml"))
    write_houses(site)
    write_models(site)
    write_photographs(site)
    write_splats(site)
    return site


@pytest.fixture
def site(built: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """`built`, as the working folder."""
    monkeypatch.chdir(built)
    return built


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "python")], ids=lambda page: page.stem)
def test_python_blocks_run(page: Path, site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Blocks of one page share their names, as if typed one after the other."""
    names: dict[str, object] = {}
    for block in blocks(page, "python"):
        exec(compile(block, str(page), "exec"), names)
    assert capsys.readouterr().out


def test_blocks_import_from_the_package_alone(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of every page and of a dataset's card, which works beside the dataset's folder."""
    card = site / "datasets" / MINI / "README.md"
    for block in (block for page in (*PAGES, card) for block in blocks(page, "python")):
        assert not re.search(r"(from|import)\s+dataset_builder\.", block), block
    monkeypatch.chdir(card.parent.parent)
    names: dict[str, dict[str, object]] = {}
    exec(compile(blocks(card, "python")[0], str(card), "exec"), names)
    assert len(names["example"]) == 2


def test_every_public_name_is_explained() -> None:
    table = prose(ROOT / "docs" / "python.md").partition("| name |")[2].partition("\n\n")[0]
    rows = re.findall(r"^\| ([^|]+) \|", table, re.MULTILINE)
    assert sorted(name for row in rows for name in re.findall(r"`(\w+)`", row)) == sorted(dataset_builder.__all__)


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "sh")], ids=lambda page: page.stem)
def test_shell_blocks_run(page: Path, site: Path) -> None:
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    for line in filter(None, "\n".join(blocks(page, "sh")).splitlines()):
        tool, *arguments = shlex.split(line)
        if tool == "make":
            assert arguments[0] in targets, line
        elif tool == "source":
            assert arguments == [".venv/bin/activate"], line
        elif tool == "dataset-builder":
            assert main(cheap(arguments)) == 0, line
        else:
            assert tool in PLAIN_TOOLS, f"{line}: teach this test to run it"
            assert subprocess.run([tool, *arguments], check=False).returncode == 0, line


@pytest.mark.parametrize("number", range(2, len(blocks(ROOT / "docs" / "scenes.md", "yaml"))))
def test_scenes_of_the_scenes_page_can_be_planned(number: int, tmp_path: Path) -> None:
    """Every scene spec after the first, with a target that it can have."""
    scene, dataset = (blocks(ROOT / "docs" / "scenes.md", "yaml")[index] for index in (number, 1))
    if "slot" in scene:
        dataset = dataset.replace("{things: {category: chair}, count: 2}", "{from: [stool.yaml], count: 1}")
    write_flat(tmp_path / "house", [scene, dataset.replace("views: 2", "views: 1").replace("count: 2", "count: 1")])
    (tmp_path / "house" / "stool.yaml").write_text("family: stool\n")
    assert main(["plan", str(tmp_path / "house" / "house.yaml"), "--views", "1", "--set", "target.brightness=[0, 100]",
                 "--set", "camera.coverage=[0.01, 0.9]"]) == 0


def test_the_message_of_the_meshes_page(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(site / "teapots", site / "wrong" / "teapots")
    spec = site / "wrong" / "teapots" / "objects" / "teapot.yaml"
    spec.write_text(spec.read_text().replace("teapot.glb", "teapto.glb"))
    (site / "wrong" / "scene_specs").symlink_to(site / "scene_specs")
    assert main(["plan", "wrong/teapots/teapots.yaml"]) == 2
    shown = blocks(ROOT / "docs" / "own-meshes.md", "text")[0].strip()
    assert shown in capsys.readouterr().err.replace("wrong/", "")


def test_the_tree_of_the_reading_page_is_whole(site: Path) -> None:
    fenced = re.findall(r"^```(\w*)\n(.*?)^```$", (ROOT / "docs" / "reading.md").read_text(), re.MULTILINE | re.DOTALL)
    tree = next(block for language, block in fenced if not language and block.startswith("datasets/"))
    folder = site / "datasets" / MINI
    columns = [re.split(r"\s{3,}", line.strip())[0].split() for line in tree.splitlines()[1:]]
    assert {name.partition("/")[0] for names in columns for name in names} == {path.name for path in folder.iterdir()}
    for name in re.findall(rf"(?:shards|index)/{MINI}[\w.-]+", tree):
        assert len(list(folder.glob(name.replace("TAG", "????????")))) == 1


@pytest.mark.parametrize("page", [*PAGES, *OTHERS], ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if not re.match(r"https?://", target):
            assert (page.parent / target.partition("#")[0]).exists(), target


def test_every_page_is_in_the_index() -> None:
    named = set(re.findall(r"\]\(([^)#\s]+)", prose(ROOT / "docs" / "index.md")))
    assert {page.name for page in (ROOT / "docs").glob("*.md")} - {"index.md"} <= named
    assert "docs/index.md" in (ROOT / "README.md").read_text()


@pytest.mark.parametrize("page", [*PAGES, *OTHERS], ids=lambda page: page.stem)
def test_files_in_running_text_exist(page: Path) -> None:
    """`rendering/transport/integrator.py` and the like, from the repository or from the package."""
    for code in inline(page):
        if re.fullmatch(r"[\w./-]+/[\w.-]*\.(py|sh)", code):
            assert any((ROOT / base / code).exists() for base in ("", "dataset_builder")), code


@pytest.mark.parametrize("page", [*PAGES, *OTHERS], ids=lambda page: page.stem)
def test_commands_in_running_text_exist(page: Path) -> None:
    known, targets = verbs(), re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    options = options_of(parser())
    for code in inline(page):
        words = code.removeprefix(".venv/bin/").split()
        if words[0] == "dataset-builder" and len(words) > 1:
            assert words[1] in known, code
        if words[0] == "make" and len(words) > 1:
            assert words[1] in targets, code
        for option in re.findall(r"(?<!\S)--[a-z-]+", code):
            assert option in options, code


def test_every_verb_is_on_the_first_page() -> None:
    shown = {code.split()[1] for code in inline(ROOT / "README.md") if code.startswith("dataset-builder ")}
    assert {verb.split()[0] for verb in verbs()} <= shown


def test_every_study_is_shown_and_run() -> None:
    studies = {f"study {name}" for name in subcommands(verbs()["study"])}
    lines = [line for page in PAGES for block in blocks(page, "sh") for line in block.splitlines()]
    for texts in (inline(ROOT / "README.md"), lines):
        assert studies <= {" ".join(text.split()[1:3]) for text in texts if text.startswith("dataset-builder study ")}


def test_every_mesh_format_is_named() -> None:
    for name in ("README.md", "docs/own-meshes.md", "docs/specs.md"):
        assert set(MESH_SUFFIXES) <= set(re.findall(r"\.\w+", (ROOT / name).read_text())), name


def test_every_factor_of_a_material_is_explained() -> None:
    table = prose(ROOT / "docs" / "materials.md").partition("| field |")[2].partition("\n\n")[0]
    explained = re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)
    assert {field.name for field in fields(Material)} == {"name", "texture", *explained}


def test_every_metric_is_defined() -> None:
    table = prose(ROOT / "docs" / "losses.md").partition("| metric |")[2].partition("\n\n")[0]
    rows = re.findall(r"^\| ([^|]+) \| (low|high) \|", table, re.MULTILINE)
    assert rows == [(metric.symbol, metric.better) for metric in METRICS]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_keys_of_specs_exist(page: Path) -> None:
    """`render.spp`, `gates.coverage` and the like, wherever they are mentioned."""
    keys = known_keys()
    for code in [*inline(page), *re.findall(r"--set '?([\w.]+)=", "\n".join(blocks(page, "sh")))]:
        path = re.sub(r"^splits\.\w+", "splits[]", re.split(r"[:=\s]", code)[0])
        if path.partition(".")[0].removesuffix("[]") in DatasetSpec.model_fields and "." in path:
            assert path.removesuffix("[]") in keys, code


@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "yaml") and page.stem not in OWN_SPECS],
                         ids=lambda page: page.stem)
def test_yaml_blocks_are_valid(page: Path) -> None:
    """Parts of dataset files fit into the mini dataset's, whole object and room files are such files."""
    for block in blocks(page, "yaml"):
        parts = YAML(typ="safe").load(block)
        if "family" in parts or isinstance(parts.get("file"), str):
            assert ObjectSpec.model_validate(parts)
        elif "materials" in parts:
            assert RoomSpec.model_validate(parts)
        else:
            spec = SEEN if "source" in str(parts.get("splits")) else MINI
            assert load_dataset(ROOT / "scene_specs" / f"{spec}.yaml", [f"{key}={json.dumps(part)}" for key, part
                                                                        in merged(parts).items()])


def merged(parts: dict[str, object]) -> dict[str, object]:
    """Overrides of single values, so that what a page leaves out stays as it is; lists as they are."""
    found = dict[str, object]()
    for name, values in parts.items():
        found |= {f"{name}.{key}": each for key, each in values.items()} if isinstance(values, dict) else {name: values}
    return found


def known_keys() -> set[str]:
    """Dotted path of every key of a dataset file."""
    models = [("", DatasetSpec), *((f"{path}.", model) for path, model in spec_tables.nested(DatasetSpec, ""))]
    return {prefix + (field.alias or name) for prefix, model in models for name, field in model.model_fields.items()}


@pytest.mark.parametrize("table_page", spec_tables.PAGES, ids=lambda page: page.name)
def test_tables_are_in_step(table_page: spec_tables.TablePage) -> None:
    assert table_page.path.read_text(encoding="utf-8") == table_page.renewed(), "run `make schema`"


@pytest.mark.parametrize("table_page", spec_tables.PAGES, ids=lambda page: page.name)
def test_every_key_is_explained(table_page: spec_tables.TablePage) -> None:
    page = table_page.path.read_text(encoding="utf-8")
    for heading, model in table_page.sections():
        section = page.partition(f"{heading}\n")[2].partition("\n#")[0]
        for name, field in model.model_fields.items():
            assert re.search(rf"^\| `{field.alias or name}` \|.*\| \S[^|]* \|$", section, re.MULTILINE), (heading, name)


def test_every_layer_is_defined_and_no_other() -> None:
    page = ROOT / "docs" / "layers.md"
    table = prose(page).partition("## Definitions")[2].partition("\n## ")[0]
    named = re.findall(r"^\| `(\w+)` \|", table, re.MULTILINE)
    others = re.findall(r"`(\w+_(?:se|raw|half))`", table)
    assert [*named, *others] == list(LAYERS) and tuple(named[:6]) == PAPER_LAYERS


def test_first_page_knows_every_layer_but_errors() -> None:
    table = prose(ROOT / "README.md").partition("| layer |")[2].partition("\n\n")[0]
    rows = re.findall(r"^\| ([^|]+) \|", table, re.MULTILINE)
    named = {name for row in rows for name in re.findall(r"`(\w+)`", row)}
    assert {name for name in LAYERS if not name.endswith("_se")} <= named <= set(LAYERS)


def test_identities_and_gates_are_in_step() -> None:
    page = prose(ROOT / "docs" / "layers.md")
    half = {name: tolerance for name, _, tolerance in identity_table("float16", True)}
    rows = re.findall(r"^\| `(\w+)` \|[^|]*\| (\S+) \| (\S+) \|$", page.partition("## Identities")[2], re.MULTILINE)
    assert [(name, float(full), float(low)) for name, full, low in rows] == [
        (name, tolerance, half[name]) for name, _, tolerance in identity_table("float32", True)]
    named = re.findall(r"^\| `(\w+)` \|", page.partition("## Gates")[2].partition("\n## ")[0], re.MULTILINE)
    assert named == [gates.COVERAGE, gates.OVERLAP, gates.ENERGY, gates.SPLIT]
    assert f"<= {gates.SIGMAS:g} e" in page and f"{gates.RARE:.1%}" in page and f"{gates.ROUNDING:.0e}"[0] == "1"


def test_pictures_are_small_enough_to_clone() -> None:
    pictures = list((ROOT / "docs" / "images").iterdir())
    assert pictures and sum(picture.stat().st_size for picture in pictures) < FEW_BYTES
