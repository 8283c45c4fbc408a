"""What a loaded dataset holds, and that its digest follows its content and nothing else."""

import shutil
from pathlib import Path

import pytest

from dataset_builder.digest import sha256_bytes
from dataset_builder.spec.load import load_dataset

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def test_references_are_keys(tiny) -> None:
    loaded = load_dataset(tiny())
    scene = loaded.scenes["scenes/den.yaml"]
    assert loaded.rooms[scene.room].depth == 3.5
    assert [loaded.objects[piece.object].family for piece in scene.furniture] == ["stool"]
    assert {key for split in loaded.dataset.splits for key in split.objects.source} == set(loaded.objects)
    assert loaded.objects["objects/chair.yaml"].category == "chair"
    with pytest.raises(TypeError):
        loaded.objects["x"] = None  # type: ignore[index]


def test_paths_are_followed_from_the_file_that_names_them(tiny) -> None:
    files = {"scenes/den.yaml": "room: rooms/inner.yaml\n", "scenes/rooms/inner.yaml": "depth: 5\n"}
    assert load_dataset(tiny(**files)).rooms["scenes/rooms/inner.yaml"].depth == 5


def test_meshes_are_found_beside_their_spec(tiny) -> None:
    files = {"objects/chair.yaml": "file: parts/a.obj\nscale: 0.01\nlicence: CC0-1.0\n",
             "objects/parts/a.obj": "mtllib a.mtl\nusemtl x\n" + TRIANGLE,
             "objects/parts/a.mtl": "newmtl x\nmap_Kd -s 1 1 1 wood.png\n", "objects/parts/wood.png": b"pixels"}
    path = tiny(**files)
    loaded = load_dataset(path)
    mesh = loaded.meshes["objects/chair.yaml"]
    assert mesh.path == (path.parent / "objects/parts/a.obj").resolve()
    assert sorted(mesh.companions) == ["a.mtl", "wood.png"]
    assert loaded.objects["objects/chair.yaml"].category == "object"


def test_images_are_found_from_the_dataset_file(tiny) -> None:
    text = "source: {environment: a.EXR}\ntarget: {textures: [sub/b.png, sub/b.png]}\n"
    files = {"tiny.yaml": tiny().read_text() + text, "a.EXR": "pixels", "sub/b.png": "texels"}
    found = load_dataset(tiny(**files)).images
    assert found == {"a.EXR": sha256_bytes(b"pixels"), "sub/b.png": sha256_bytes(b"texels")}


def test_the_digest_ignores_place_layout_and_comments(tiny, tmp_path: Path) -> None:
    path = tiny()
    first = load_dataset(path).spec_digest
    moved = tmp_path / "else" / "where"
    shutil.copytree(path.parent, moved)
    assert load_dataset(moved / "tiny.yaml").spec_digest == first
    text = path.read_text().replace("seed: 3\n", "").replace("{sigma: 0.01}", "\n  sigma: 1e-2 # rough") + "seed: 3\n"
    assert load_dataset(tiny(**{"tiny.yaml": text, "rooms/den.yaml": "depth: 3.5\nwidth: 4.0\n"})).spec_digest == first


@pytest.mark.parametrize(("file", "old", "new"), [
    ("tiny.yaml", "seed: 3", "seed: 4"), ("tiny.yaml", "0.01", "0.011"), ("tiny.yaml", "count: 2", "count: 1"),
    ("objects/chair.yaml", "0.42", "0.43"), ("rooms/den.yaml", "3.5", "3.6"), ("scenes/den.yaml", "near", "wall"),
    ("objects/stool.yaml", "file: s.gltf", "file: s.gltf\nup: z"), ("objects/s.gltf", '"2.0"', '"2.1"'),
    ("objects/s.bin", "bytes", "bites"), ("objects/s.png", "pixels", "pixel"), ("sun.hdr", "noon", "dusk"),
    ("moon.exr", "full", "half"), ("lamps/a.png", "red", "blue"), ("lamps/b.exr", "green", "gray"),
])
def test_the_digest_follows_the_content(tiny, file: str, old: str, new: str) -> None:
    images = '[{"uri": "s.png"}, {"uri": "data:,"}]'
    gltf = f'{{"asset": {{"version": "2.0"}}, "buffers": [{{"uri": "s.bin"}}], "images": {images}}}'
    lights = "source: {environment: sun.hdr}\ntarget: {environment: moon.exr, textures: [lamps/a.png, lamps/b.exr]}\n"
    train_only = tiny().read_text().split("  - name: test")[0] + lights
    shown = {"sun.hdr": "noon", "moon.exr": "full", "lamps/a.png": "red", "lamps/b.exr": "green"}
    files = shown | {"tiny.yaml": train_only, "objects/stool.yaml": "file: s.gltf\nlicence: CC0-1.0\n",
             "objects/s.gltf": gltf, "objects/s.bin": "bytes", "objects/s.png": "pixels"}
    path = tiny(**files)
    before = load_dataset(path).spec_digest
    text = (path.parent / file).read_text()
    assert old in text
    assert load_dataset(tiny(**files | {file: text.replace(old, new)})).spec_digest != before


def digests(path: Path) -> dict[str, str]:
    """What the examples of each split depend on."""
    loaded = load_dataset(path)
    return {split.name: loaded.split_digest(split, 4) for split in loaded.dataset.splits}


@pytest.mark.parametrize("added", ["title: Other\n", "description: Other words.\n", "version: 1.2.3\n"])
def test_what_is_said_of_a_dataset_makes_no_other_examples(tiny, added: str) -> None:
    before, whole = digests(tiny()), load_dataset(tiny()).spec_digest
    path = tiny(**{"tiny.yaml": tiny().read_text() + added})
    assert digests(path) == before and load_dataset(path).spec_digest != whole


def test_a_split_depends_on_nothing_of_another(tiny) -> None:
    before = digests(tiny())
    text = tiny().read_text() + ("  - name: more\n    objects: {count: 1, from: [objects/new.yaml]}\n"
                                 "    scenes: {count: 1, from: [scenes/new.yaml]}\n")
    files = {"tiny.yaml": text, "objects/new.yaml": "family: bench\n", "scenes/new.yaml": "room: ../rooms/new.yaml\n",
             "rooms/new.yaml": "depth: 6\n"}
    after = digests(tiny(**files))
    assert {name: after[name] for name in before} == before and set(after) - set(before) == {"more"}
    other = digests(tiny(**{**files, "rooms/new.yaml": "depth: 7\n"}))
    assert {name for name in after if after[name] != other[name]} == {"more"}


def test_a_split_depends_on_all_that_it_uses_and_on_its_place(tiny) -> None:
    before = digests(tiny())
    for file, text, touched in (
            ("rooms/den.yaml", "depth: 9\n", {"train", "test"}), ("objects/chair.yaml", "family: chair\n", {"train"}),
            ("tiny.yaml", tiny().read_text().replace("seed: 3", "seed: 4"), {"train", "test"})):
        after = digests(tiny(**{file: text}))
        assert {name for name in before if after[name] != before[name]} == touched
    loaded = load_dataset(tiny())
    split = loaded.dataset.splits[0]
    assert loaded.split_digest(split, 0) != loaded.split_digest(split, 1)
