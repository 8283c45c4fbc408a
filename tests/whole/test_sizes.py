"""Objects of any size are planned, or refused with the file, the line of the spec and a remedy that works."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from dataset_builder.cli.main import main
from dataset_builder.errors import PlanError, UserError
from dataset_builder.planning.cost import estimate
from dataset_builder.planning.plan import Planner
from dataset_builder.planning.precheck import probe, read_meshes
from dataset_builder.spec.load import load_dataset

SCENES = Path(__file__).parents[2] / "scene_specs" / "scenes"
DATASET = """\
name: sizes
splits:
  - name: train
    objects: {{count: {count}, from: [{objects}]}}
    scenes: {{count: 1, from: [scene.yaml]}}
    views: 4
"""
Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes a dataset of mesh files, by name the mesh or its bytes and what the object's spec says besides; the
    path of the dataset file."""

    def make(models: dict[str, tuple[trimesh.Trimesh | bytes, str]], room: str = "", scene: str = "",
             more: str = "") -> Path:
        for name, (mesh, said) in models.items():
            path = tmp_path / name
            if isinstance(mesh, bytes):
                path.write_bytes(mesh)
            else:
                mesh.export(path)
            path.with_suffix(".yaml").write_text(f"licence: CC0-1.0\nfile: {name}\n{said}")
        names = [Path(name).stem + ".yaml" for name in models if "furniture" not in name]
        (tmp_path / "room.yaml").write_text(room or "windows: 1\n")
        (tmp_path / "scene.yaml").write_text(scene or "room: room.yaml\n")
        path = tmp_path / "sizes.yaml"
        path.write_text(DATASET.format(count=len(names), objects=", ".join(names)) + more)
        return path

    return make


def ring() -> trimesh.Trimesh:
    return trimesh.creation.torus(major_radius=0.009, minor_radius=0.001)


def box(*extents: float) -> trimesh.Trimesh:
    return trimesh.creation.box(extents=extents)


@pytest.mark.parametrize(("name", "mesh"), [
    ("banana", box(0.04, 0.012, 0.012)), ("ring", ring()), ("spoon", box(0.04, 0.008, 0.002)),
    ("vase", trimesh.creation.cylinder(radius=0.05, height=0.2)), ("sofa", box(2.2, 0.9, 0.85)),
])
def test_small_things_are_planned_in_a_living_room(write: Write, name: str, mesh: trimesh.Trimesh) -> None:
    path = write({f"{name}.ply": (mesh, f"category: {name}\nup: z\n")}, scene=(SCENES / "living_room.yaml").read_text()
                 .replace("../", f"{SCENES.parent}/"))
    planner = Planner(load_dataset(path))
    radius = np.linalg.norm(mesh.extents) / 2
    for ref in planner.examples:
        plan = planner.example(ref)
        assert 0.08 <= plan.camera.coverage <= 0.6 and plan.camera.visibility >= 0.6
        clear = planner.arrangement(ref.view.pair).everything.distance(np.array([plan.camera.position]))[0]
        assert clear >= min(0.15, radius / 2) - 1e-6


@pytest.mark.parametrize(("name", "edge", "scale"), [
    ("m.glb", 60.0, "0.01"), ("m.ply", 600.0, "0.001"), ("m.ply", 0.0006, "1000"), ("m.obj", 35.0, "0.01")])
def test_a_wrong_unit_names_the_file_its_line_and_a_scale_that_works(write: Write, name: str, edge: float, scale: str,
                                                                      capsys: pytest.CaptureFixture[str]) -> None:
    path = write({name: (box(edge, edge, edge), "category: thing\n")}, "width: 6\ndepth: 6\n")
    assert main(["plan", str(path)]) == 2
    said = capsys.readouterr().err.splitlines()
    rule = rf"m\.yaml:2: scale: {re.escape(name)}: expected an object of 2 cm to 20 m, got one"
    assert re.match(rf"error: .*/{rule}", said[0])
    assert f"write `scale: {scale}`" in said[0] and ("glTF is in metres" in said[0]) == (name == "m.glb")
    assert not any("widen `fov`" in line for line in said)
    spec = path.parent / "m.yaml"
    spec.write_text(spec.read_text() + f"scale: {scale}\n")
    assert main(["plan", str(path)]) == 0


def test_an_unusual_size_is_told_in_the_plan_and_in_the_label(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    path = write({"chair.ply": (box(2.5, 1.0, 2.0), "category: chair\n")}, "width: 8\ndepth: 8\nheight: 4\n")
    planner = Planner(load_dataset(path))
    rule = "expected a chair of 0.4 m to 1.5 m, got one whose largest extent is 2.5 m"
    assert planner.example(planner.examples[0]).notes[0] == f"unusual size of train-chair-00: {rule}"
    warning, = estimate(planner, views=1).warnings
    assert warning.startswith(f"{path.parent}/chair.yaml:2: scale: chair.ply: {rule} (write `scale: ")
    assert main(["plan", str(path)]) == 0 and "unusual" not in capsys.readouterr().err


def test_a_bed_on_its_side_is_told_and_mended(write: Write) -> None:
    path = write({"bed.ply": (box(1.6, 2.0, 0.9), "category: bed\n")}, "width: 8\ndepth: 8\nheight: 4\n")
    warning, = read_meshes(Planner(load_dataset(path))).warnings
    assert "bed.yaml:2: up: bed.ply: expected a bed to be lower than deep" in warning and "try `up: z`" in warning
    spec = path.parent / "bed.yaml"
    spec.write_text(spec.read_text() + "up: z\n")
    assert not read_meshes(Planner(load_dataset(path))).warnings


def test_all_that_is_wrong_with_mesh_files_is_told_at_once(write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    """Of objects and of furniture, each with its file and the line of the spec that names it."""
    path = write({"a.ply": (b"ply\nformat ascii 1.0\nend_header\n", ""),
                  "b.obj": (b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3", ""),
                  "huge.ply": (box(1000, 1, 1), "category: sofa\n"), "good.ply": (box(1, 1, 1), ""),
                  "furniture.ply": (b"ply\nformat ascii 1.0\nelement vertex 1\nend_header\n", ""),
                  "furniture2.ply": (box(1, 1, 1), "materials: {oak: {roughness: 1}}\n")},
                 scene="room: room.yaml\nfurniture:\n  - {object: furniture.yaml}\n  - {object: furniture2.yaml}\n")
    build = ["build", str(path), "--out", str(path.parent / "out"), "--backend", "llvm"]
    for verb in (["plan", str(path)], ["plan", str(path), "--example", "0"], build):
        assert main(verb) == 2
        errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
        assert [re.search(r"(\w+)\.yaml:2: (file|scale): ", line)[1] for line in errors] == [
            "a", "b", "huge", "furniture", "furniture2"]
        for line, said in zip(errors, ("a.ply", "b.obj", "huge.ply", "furniture.ply", "materials.oak"), strict=True):
            assert said in line
        assert not (path.parent / "out" / "dataset.json").exists()


def refused(path: Path, *overrides: str) -> str:
    with pytest.raises(PlanError) as caught:
        probe(Planner(load_dataset(path, overrides)))
    return str(caught.value)


@pytest.mark.parametrize(("extents", "overrides", "cause", "remedies"), [
    ((0.04, 0.012, 0.012), ["camera.clearance=0.15"], "closer than the clearance",
     [["camera.clearance=auto"], ["camera.clearance=0.01"], ["camera.coverage=[0.0005, 0.002]"], ["camera.fov=4"]]),
    ((0.2, 0.002, 0.002), [], "closer than the clearance", [["camera.coverage=[0.002, 0.01]"]]),
    ((1.5, 1.5, 1.5), ["camera.coverage=[0.01, 0.02]"], "outside the room at any coverage",
     [["camera.fov=150"], ["camera.coverage=[0.2, 0.5]"], {"room.yaml": "width: 14\ndepth: 14\nheight: 9\n"},
      {"m.yaml": "scale: 0.2\n"}]),
    ((1.2, 0.02, 0.02), ["camera.coverage=[0.06, 0.08]", "camera.visibility=0.95", "camera.clearance=0"],
     "cut by the frame",
     [["camera.coverage=[0.005, 0.01]"], ["camera.visibility=0.2"]]),
    ((0.5, 0.5, 0.5), ["camera.clearance=0.6", "camera.coverage=[0.1, 0.12]", "camera.elevation=70"],
     "closer than the clearance allows to walls",
     [["camera.clearance=0.1"], ["camera.coverage=[0.3, 0.5]"], ["camera.fov=70"], {"room.yaml": "height: 5\n"}]),
])
def test_remedies_work(write: Write, extents: tuple[float, ...], overrides: list[str], cause: str,
                       remedies: list[list[str] | dict[str, str]]) -> None:
    """What is named as the cause is the cause: each remedy alone, put where the message says, makes a plan."""
    path = write({"m.ply": (box(*extents), "category: object\nup: z\n")})
    said = refused(path, *overrides)
    assert re.search(rf"got none in 200 draws: \d+ [^;]*{cause}", said)
    for remedy in remedies:
        if isinstance(remedy, dict):
            before = {name: (path.parent / name).read_text() for name in remedy}
            for name, text in remedy.items():
                (path.parent / name).write_text((before[name] if name == "m.yaml" else "") + text)
            probe(Planner(load_dataset(path, overrides)))
            for name, text in before.items():
                (path.parent / name).write_text(text)
            continue
        key = remedy[0].partition("=")[0]
        assert key in said or key.removeprefix("camera.") in said
        probe(Planner(load_dataset(path, [*overrides, *remedy])))


def test_clearance_takes_numbers_and_auto(write: Write) -> None:
    path = write({"m.ply": (box(1, 1, 1), "")})
    for wrong in ("-1", "near", "true"):
        with pytest.raises(UserError, match=r"camera\.clearance: expected"):
            load_dataset(path, [f"camera.clearance={wrong}"])
    assert load_dataset(path, ["camera.clearance=1"]).dataset.camera.clearance == 1
