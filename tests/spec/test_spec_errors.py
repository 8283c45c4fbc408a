"""Every broken rule of a spec, all at once, with where, path, rule, value and the nearest known key."""

from pathlib import Path

import pytest

from dataset_builder.errors import SpecError
from dataset_builder.spec.image_uses import ENVIRONMENT_SUFFIXES, TEXTURE_SUFFIXES
from dataset_builder.spec.light import SourceSpec, TargetSpec
from dataset_builder.spec.load import load_dataset

HEAD = """\
name: tiny
splits:
  - name: train
    objects: {count: 2, from: [objects/chair.yaml, objects/stool.yaml]}
    scenes: {count: 1, from: [scenes/den.yaml]}
"""


def messages(path: Path) -> list[str]:
    with pytest.raises(SpecError) as caught:
        load_dataset(path)
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize(("extra", "message"), [
    ("rough: {sigma: -0.1}", "tiny.yaml:6: rough.sigma: expected >= 0, got -0.1"),
    ("rough:\n  sigma: [0, -1]", "tiny.yaml:7: rough.sigma[1]: expected >= 0, got -1"),
    ("rough: {sigma: abc}", "rough.sigma: expected a number or one of uniform, log_uniform, normal, choice, got 'abc'"),
    ("rough: {sigma: '5'}", "rough.sigma: expected a number or one of uniform, log_uniform, normal, choice, got '5'"),
    ("rough: {sigma: {unifrom: [0, 1]}}", "got {unifrom: [0, 1]} (nearest known key: uniform)"),
    ("rough: {steps: [{kind: bump}]}", "close_holes, got {kind: 'bump'} (nearest known kind: bumps)"),
    ("rough: {sigma: {uniform: [1, 0]}}", "rough.sigma.uniform: expected low <= high, got [1, 0]"),
    ("rough: {sigma: {uniform: [-1, 1]}}", "rough.sigma: expected >= 0, got [-1, 1]"),
    ("rough: {sigma: {uniform: [0, x]}}", "rough.sigma.uniform[1]: expected a number, got 'x'"),
    ("rough: {sigma: {uniform: [0, 1], choice: [1]}}", "rough.sigma.choice: expected no such key, got [1]"),
    ("rough: {sigma: .nan}", "rough.sigma: expected a finite number, got nan"),
    ("rough: {sigma: 1e400}", "rough.sigma: expected a finite number, got inf"),
    ("rough: {sigma: []}", "rough.sigma: expected 1 or more entries, got []"),
    ("rough:\n  sigmaa: 1", "tiny.yaml:7: rough.sigmaa: expected no such key, got 1 (nearest known key: sigma)"),
    ("renderer: {spp: 4}", "tiny.yaml:6: renderer: expected no such key, got {spp: 4} (nearest known key: render)"),
    ("render: {spp: 0}", "tiny.yaml:6: render.spp: expected >= 1, got 0"),
    ("render: {spp: 16777217}", "tiny.yaml:6: render.spp: expected <= 16777216, got 16777217"),
    ("render: {spp: {target: [4, 16777220]}}", "render.spp.target[1]: expected <= 16777216, got 16777220"),
    ("render: {spp: {target: [8388608, 8388608, 4]}}",
     "render.spp.target: expected at most 16777216 samples in all, got 16777220"),
    ("render: {accuracy: {i_s: {error: 0.1, cap: 16777217}}}",
     "render.accuracy.i_s.cap: expected <= 16777216, got 16777217"),
    ("render: {spp: 6}", "render.spp.source: expected a multiple of batches (4), got 6"),
    ("render: {spp: {targt: 8}}", "render.spp.targt: expected no such key, got 8 (nearest known key: target)"),
    ("render: {max_depth: true}", "render.max_depth: expected a whole number or auto, got true"),
    ("render: {max_depth: '8'}", "render.max_depth: expected a whole number or auto, got '8'"),
    ("render: {max_depth: 1.5}", "render.max_depth: expected a whole number or auto, got 1.5"),
    ("render: {transport: joint}",
     "render.transport: expected 'auto', 'camera' or 'joined', got 'joint' (nearest: joined)"),
    ("render: {transport: true}", "render.transport: expected 'auto', 'camera' or 'joined', got true"),
    ("render: [1]", "tiny.yaml:6: render: expected a mapping, got [1]"),
    ("render:", "tiny.yaml:6: render: expected a mapping, got nothing"),
    ("layers: {dd: object}", "layers.dd: expected a layer, got 'dd' (nearest known name: d)"),
    ("layers: {d: objct}", "layers.d: expected 'object' or 'frame', got 'objct' (nearest: object)"),
    ("layers: {}", "layers: expected 1 or more entries, got {}"),
    ("target: {lights: 0}", "target.lights: expected in [1, 1024], got 0"),
    ("target: {kinds: [area, neon]}", "target.kinds[1]: expected 'area', 'sphere', 'spot' or 'point', got 'neon'"),
    ("camera: {coverage: [0.5, 0.1]}", "camera.coverage: expected low <= high, got [0.5, 0.1]"),
    ("camera: {coverage: [0.5, 2]}", "camera.coverage: expected bounds in [0, 1], got [0.5, 2]"),
    ("camera: {coverage: 0.5}", "camera.coverage: expected a list, got 0.5"),
    ("camera: {visibility: 1.2}", "camera.visibility: expected <= 1, got 1.2"),
    ("camera: {fov: {normal: [60, 40]}}", "camera.fov: expected in [1, 170], got [-100, 220]"),
    ("seed: -1", "seed: expected >= 0, got -1"),
    ("title: 5", "title: expected text, got 5"),
    ("render:\n  accuracy:\n    i_t:\n      error: 0.1\n      cap: 63", "tiny.yaml:10: render.accuracy.i_t.cap: "
     "expected >= the spp of its pass, 64 of target, got 63"),
    ("render: {spp: 8000, accuracy: {i_s: {error: 0.1}}}",
     "tiny.yaml:6: render.accuracy.i_s.cap: expected >= the spp of its pass, 8000 of source, got 4096"),
    ("render: {accuracy: {air: {error: 0.1}}}",
     "render.accuracy.air: expected layers that the dataset holds, got air (known names: i_s, d, r, i_t, "),
    ("render:\n  denoise:\n    layers:\n    - i_t\n    - s\n    - i_t",
     "tiny.yaml:11: render.denoise.layers[2]: expected each layer once, got i_t again"),
    ("source:\n  environment: sky.exr", "tiny.yaml:7: source.environment: expected an image, found none at 'sky.exr'"),
    ("target: {environment: sky.png}", "tiny.yaml:6: target.environment: expected a file that ends in one of "
     ".exr .hdr, got 'sky.png' (convert it)"),
    ("target: {environment: sky.exr.d/sky.hdr}", "target.environment: expected an image, found none at "
     "'sky.exr.d/sky.hdr' (its folder does not exist)"),
    ("target:\n  textures:\n  - a.hdr", "tiny.yaml:8: target.textures[0]: expected a file that ends in one of "
     ".exr .png, got 'a.hdr' (convert it)"),
    ("target: {textures: ['']}", "target.textures[0]: expected a file that ends in one of .exr .png, got ''"),
    ("version: one", r"version: expected text that matches ^\d+\.\d+\.\d+$, got 'one'"),
    ("source: {sun: {elevation: 95}}", "source.sun.elevation: expected in [0, 90], got 95"),
    ("storage: {standard_errors: 1}", "storage.standard_errors: expected true or false, got 1"),
])
def test_one_broken_rule_is_one_problem(in_folder, extra: str, message: str) -> None:
    found = messages(in_folder(**{"tiny.yaml": HEAD + extra + "\n"}))
    assert len(found) == 1
    assert message in found[0]


@pytest.mark.parametrize(("file", "content", "message"), [
    ("objects/chair.yaml", "family: chiar\n", "objects/chair.yaml:1: family: expected a family, got 'chiar' "
     "(nearest known name: chair)"),
    ("objects/chair.yaml", "family: chair\nparams:\n  widht: 0.4\n", "objects/chair.yaml:3: params.widht: expected a "
     "parameter of chair, got 'widht' (nearest known name: width)"),
    ("objects/chair.yaml", "family: chair\nparams: {width: 40}\n",
     "objects/chair.yaml:2: params.width: expected in [0.38, 0.6], got 40 (across the seat, unit m)"),
    ("objects/chair.yaml", "category: x\n", "chair.yaml:1: expected exactly one of `family` and `file`, got neither"),
    ("objects/chair.yaml", "file: a.ply\n\nparams: {a: 1}\n", "objects/chair.yaml:3: params: expected no parameters"),
    ("objects/chair.yaml", "file: a.ply\nlicence: CC0-1.0\n",
     "objects/chair.yaml:1: file: expected a mesh file, found none at 'a.ply'"),
    ("objects/chair.yaml", "file: a.step\nlicence: CC0-1.0\n",
     "objects/chair.yaml:1: file: expected a format that is read, got 'a.step': STEP is not read (export glTF from "
     "FreeCAD)"),
    ("objects/chair.yaml", "file: a.jpg\nlicence: CC0-1.0\n",
     "expected a file that ends in one of .glb .gltf .obj .off .ply .stl .npz .usd .usda .usdc .usdz, got 'a.jpg'"),
    ("scenes/den.yaml", "room: ../rooms/dem.yaml\n", "scenes/den.yaml:1: room: expected a spec file, found none at "
     "'../rooms/dem.yaml' (nearest known file: den.yaml)"),
    ("scenes/den.yaml", "furniture: []\n", "scenes/den.yaml:1: expected exactly one of `room` and `file`, got neither"),
    ("scenes/den.yaml", "room: ../rooms/den.yaml\nfurniture:\n  - {object: ../objects/x.yaml}\n",
     "scenes/den.yaml:3: furniture[0].object: expected a spec file, found none at '../objects/x.yaml'"),
    ("rooms/den.yaml", "width: 0\n", "rooms/den.yaml:1: width: expected in [1, 100], got 0"),
    ("rooms/den.yaml", "width: 4\nwidth: 5\n", "rooms/den.yaml:2: width: expected each key once"),
    ("rooms/den.yaml", "", "rooms/den.yaml:1: expected a mapping of keys, got an empty file"),
])
def test_named_files_are_checked_too(in_folder, file: str, content: str, message: str) -> None:
    found = messages(in_folder(**{file: content}))
    assert len(found) == 1
    assert message in found[0]


@pytest.mark.parametrize(("splits", "message"), [
    ("[]", "tiny.yaml:2: splits: expected 1 or more entries, got []"),
    ("[{name: a}]", "tiny.yaml:2: splits[0].objects: expected a value, the key is missing"),
    ("[{name: A-b, objects: {count: 1, from: [objects/stool.yaml]}, scenes: {count: 1, from: [scenes/den.yaml]}}]",
     "splits[0].name: expected text that matches"),
    ("[{name: a, pairs: 7, objects: {count: 2, from: [objects/stool.yaml]}, "
     "scenes: {count: 3, from: [scenes/den.yaml]}}]",
     "splits[0].pairs: expected <= 2 objects x 3 scenes = 6, got 7"),
    ("[{name: a, pairs: no, objects: {count: 2, from: [objects/stool.yaml]}, "
     "scenes: {count: 3, from: [scenes/den.yaml]}}]",
     "splits[0].pairs: expected a whole number or all, got 'no'"),
])
def test_splits(in_folder, splits: str, message: str) -> None:
    found = messages(in_folder(**{"tiny.yaml": f"name: tiny\nsplits: {splits}\n"}))
    assert any(message in line for line in found)


def test_two_splits_of_one_name(in_folder) -> None:
    twice = HEAD + HEAD.split("splits:\n")[1]
    assert messages(in_folder(**{"tiny.yaml": twice})) == [
        "tiny.yaml:6: splits[1].name: expected split names to differ, got train again"]


def test_every_image_is_checked_whatever_else_is_wrong(in_folder, tmp_path: Path) -> None:
    (tmp_path / "folder.hdr").mkdir()
    text = HEAD + ("seed: -1\nsource: {environment: folder.hdr}\n"
                   "target: {environment: lamp.exr, textures: [lanp.exr, lamp.exr, b.png]}\n")
    assert messages(in_folder(**{"tiny.yaml": text, "lamp.exr": "texels"})) == [
        "tiny.yaml:6: seed: expected >= 0, got -1",
        "tiny.yaml:7: source.environment: expected an image, got the folder 'folder.hdr' (name a file in it)",
        "tiny.yaml:8: target.textures[0]: expected an image, found none at 'lanp.exr' (nearest known file: lamp.exr)",
        "tiny.yaml:8: target.textures[2]: expected an image, found none at 'b.png'"]


def test_a_cap_may_be_the_first_round(in_folder) -> None:
    text = HEAD + "render: {spp: {rough: 16}, accuracy: {s_prime: {error: 0.1, cap: 16}}}\n"
    assert load_dataset(in_folder(**{"tiny.yaml": text})).dataset.render.accuracy["s_prime"].cap == 16


def test_suffixes_are_those_that_the_keys_explain() -> None:
    for model, key, suffixes in ((SourceSpec, "environment", ENVIRONMENT_SUFFIXES),
                                 (TargetSpec, "environment", ENVIRONMENT_SUFFIXES),
                                 (TargetSpec, "textures", TEXTURE_SUFFIXES)):
        assert f"({' '.join(suffixes)})" in (model.model_fields[key].description or "")


def test_all_problems_of_all_files_at_once(in_folder) -> None:
    path = in_folder(**{
        "tiny.yaml": HEAD.replace("objects/stool.yaml", "objects/stol.yaml") + "rough: {sigma: -1}\nspp: 4\n",
        "objects/chair.yaml": "family: chair\nparams: {width: 9, leg: 9}\n",
        "scenes/den.yaml": "room: ../rooms/den.yaml\nfurnitur: []\n",
        "rooms/den.yaml": "width: wide\n\theight: 2\n",
    })
    assert [line.split(": expected")[0] for line in messages(path)] == [
        "tiny.yaml:6: rough.sigma", "tiny.yaml:7: spp", "objects/chair.yaml:2: params.width",
        "objects/chair.yaml:2: params.leg", "tiny.yaml:4: splits[0].objects.from[1]", "scenes/den.yaml:2: furnitur",
        "rooms/den.yaml:2"]


def test_the_dataset_file_itself(tmp_path: Path) -> None:
    assert messages(tmp_path / "none.yaml") == [f"{tmp_path}/none.yaml: expected a file, found none"]


TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def test_splits_share_no_mesh_file(in_folder) -> None:
    split = "  - {{name: {0}, objects: {{count: 1, from: [{1}]}}, scenes: {{count: 1, from: [scenes/den.yaml]}}}}\n"
    text = "name: tiny\nsplits:\n" + split.format("a", "objects/chair.yaml") + split.format("b", "objects/stool.yaml")
    mesh = {"objects/chair.yaml": "file: a.obj\nlicence: CC0-1.0\n", "objects/a.obj": TRIANGLE,
            "objects/stool.yaml": "file: b.obj\nlicence: CC0-1.0\n"}
    assert load_dataset(in_folder(**{"tiny.yaml": text, "objects/b.obj": TRIANGLE + "# other\n"} | mesh)).meshes
    assert messages(in_folder(**{"tiny.yaml": text, "objects/b.obj": TRIANGLE} | mesh)) == [
        "tiny.yaml:4: splits[1].objects.from[0]: expected objects that no other split has, got a mesh file of split a "
        "(give it others, or write `allow_shared: [objects]` in one of both splits)"]


def test_a_mesh_file_is_one_object(in_folder) -> None:
    text = HEAD.replace("count: 2", "count: 3")
    path = in_folder(**{"tiny.yaml": text, "objects/chair.yaml": "file: a.obj\nlicence: CC0-1.0\n",
                        "objects/a.obj": TRIANGLE})
    assert messages(path) == ["tiny.yaml:4: splits[0].objects.count: expected <= 2, since each mesh file is one "
                              "object, got 3"]


@pytest.mark.parametrize(("name", "content", "message"), [
    ("a.obj", "mtllib a.mtl\n" + TRIANGLE, "expected the files that a.obj names, found no a.mtl beside it "
     "(a.obj, line 1: mtllib)"),
    ("a.gltf", '{"asset": {"version": "2.0"}, "buffers": [{"uri": "a.bin"}]}',
     "expected the files that a.gltf names, found no a.bin beside it"),
    ("a.gltf", "{", "expected a .gltf file, got one that cannot be read"),
    ("a.gltf", "[]", "expected a .gltf file, got one that cannot be read"),
])
def test_files_that_a_mesh_needs(in_folder, name: str, content: str, message: str) -> None:
    spec = f"file: {name}\nlicence: CC0-1.0\n"
    found = messages(in_folder(**{"objects/chair.yaml": spec, f"objects/{name}": content}))
    assert len(found) == 1
    assert message in found[0]
