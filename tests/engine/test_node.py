"""One machine of a build on many, in this process: what it unpacks, sends back, and refuses."""

import os
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest

from dataset_builder.engine.field_tasks import NeededFields, make_one
from dataset_builder.engine.node import Delivery, Hands, Shipment, keep, require_same
from dataset_builder.engine.parcel import STALE, Parcel, build_folder, forget, own_folder
from dataset_builder.engine.ray_running import shipment_of
from dataset_builder.engine.rejected_pixels import MAX_PICTURES, pictures
from dataset_builder.engine.unit import BuildJob, planner_of
from dataset_builder.errors import OutputError, SpecError, UserError
from dataset_builder.planning.catalogue import units
from dataset_builder.planning.field_needs import field_needs
from dataset_builder.spec.load import load_dataset
from tests.assets.readers.wavefront_files import TRIANGLE, png
from tests.small_fields import field_of, room
from tests.small_specs import write_spec

FAR = {
    "in/deep/small.yaml": """\
name: small
seed: 1
image: {width: 24, height: 20}
source: {environment: ../sky/sky.exr}
splits:
  - name: train
    objects: {count: 1, from: [../objects/leaf.yaml]}
    scenes: {count: 1, from: [../../flat.yaml]}
""",
    "in/objects/leaf.yaml": "file: ../../meshes/leaf.obj\nlicence: CC0-1.0\n",
    "meshes/leaf.obj": TRIANGLE, "meshes/a.mtl": "newmtl m\nmap_Kd wood/oak.png\n", "meshes/unnamed.txt": "",
    "meshes/wood/oak.png": png([[[9, 9, 9]]]), "in/sky/sky.exr": "", "in/sky/other.exr": "",
    "flat.yaml": "file: {path: room.npz, licence: CC-BY-4.0}\n",
}
"""Files of a spec that lie all about; two are none of it."""


def far_spec(folder: Path) -> Path:
    """The spec, written."""
    from dataset_builder.assets.field_file import write_field

    for name, content in FAR.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    write_field(folder / "room.npz", field_of(room()))
    return folder / "in/deep/small.yaml"


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The temporary folder of a machine."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "machine"))
    (tmp_path / "machine").mkdir()
    return tmp_path / "machine"


def test_a_spec_travels_with_all_that_it_names_and_no_more(tmp_path: Path) -> None:
    loaded = load_dataset(far_spec(tmp_path / "here"), ["image.width=32"])
    parcel, paths = Parcel.of(loaded)
    assert set(parcel.names) == {*FAR, "room.npz"} - {"meshes/unnamed.txt", "in/sky/other.exr"}
    there = parcel.unpacked(tmp_path / "there", [path.read_bytes for path in paths])
    assert there == tmp_path / "there" / "in/deep/small.yaml"
    assert load_dataset(there, loaded.overrides).spec_digest == loaded.spec_digest
    # Whoever comes second finds it
    assert parcel.unpacked(tmp_path / "there", []) == there
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith("unpacking")] == []


def test_a_parcel_that_cannot_be_unpacked_leaves_nothing(tmp_path: Path) -> None:
    def broken() -> bytes:
        raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match="disk is full"):
        Parcel(names=("a/b",), folders=(), spec="a/b").unpacked(tmp_path / "there", [broken])
    assert list(tmp_path.iterdir()) == []


def shipped(spec: Path, folder: Path, *overrides: str) -> tuple[BuildJob, Shipment]:
    """A build of a spec, and what machines get of it: the bytes themselves stand for them."""
    import ray

    job = BuildJob.of(load_dataset(spec, overrides), folder, backend="llvm", threads=1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ray, "put", lambda value: value)
        return job, shipment_of(job, "b" * 32)


def test_the_spec_is_taken_from_where_it_is_or_unpacked(machine: Path, tmp_path: Path) -> None:
    spec = write_spec(tmp_path / "spec")
    job, shipment = shipped(spec, tmp_path / "out")
    assert Hands.ready(shipment, bytes).job.spec_path == spec
    spec.write_text(spec.read_text().replace("seed: 1", "seed: 2"))
    planner_of.cache_clear()
    hands = Hands.ready(shipment, bytes)
    assert hands.job.spec_path.is_relative_to(machine) and planner_of(hands.job).loaded.dataset.seed == 1
    forget(shipment.build)
    assert not list((own_folder() / "builds").iterdir())
    wrong = replace(shipment, contents=tuple(data.replace(b"seed: 1", b"seed: 3") for data in shipment.contents))
    planner_of.cache_clear()
    with pytest.raises(UserError, match=r"machine .*: the spec cannot be used there: .*got a changed one"):
        Hands.ready(wrong, bytes)
    with pytest.raises(SpecError):
        planner_of(job)


def test_a_field_travels_back_and_on(machine: Path, tmp_path: Path) -> None:
    spec = write_spec(tmp_path / "spec")
    source = "{kind: field, views: 24, held_out: 4, size: 32, spp: 4, resolution: 32, steps: 40}"
    job, shipment = shipped(spec, tmp_path / "out", f"splits.test.source={source}",
                            "layers={i_s: object, i_t: object, d: object, mask: object, mask_field: object}")
    hands, planner = Hands.ready(shipment, bytes), planner_of(job)
    tasks = list(NeededFields.of(field_needs(planner, planner.examples), job.fields).tasks.values())
    delivery = hands.work(make_one, tasks[0], frozenset(), (lambda news: None,))
    assert delivery.result.record is not None and job.fields.find(tasks[0], spec.parent) is None
    keep(delivery, job)
    assert job.fields.find(tasks[0], spec.parent) is not None
    for path in (machine / f"3df-lighting-{os.getuid()}" / "cache" / "fields").iterdir():
        path.unlink()
    _, second = shipped(spec, tmp_path / "out", *job.overrides)
    assert list(second.fields) == [job.fields.key(tasks[0])]
    hands = Hands.ready(second, bytes)
    train, test = units(planner.examples)[0], units(planner.examples)[-1]
    hands._bring_fields(train)
    assert hands.job.fields.find(tasks[0], spec.parent) is None
    hands._bring_fields(test)
    assert hands.job.fields.find(tasks[0], spec.parent) is not None


def test_pixels_of_few_rejected_examples_are_kept(tmp_path: Path, small_spec: Path) -> None:
    job = BuildJob.of(load_dataset(small_spec), tmp_path, backend="llvm", threads=1)
    for number in range(MAX_PICTURES + 3):
        keep(Delivery(pixels={f"{number:08d}.npz": b"a", f"{number:08d}.png": b"b"}), job)
    assert len(pictures(tmp_path)) == 2 * MAX_PICTURES


def test_what_differs_is_named() -> None:
    require_same({"numpy": "2.0"}, {"numpy": "2.0"}, "m")
    with pytest.raises(UserError, match=r"^machine m: .* got llvm none instead of 19, numpy 2\.1 instead of 2\.0, "
                                        r"source another one \("):
        require_same({"numpy": "2.0", "llvm": "19", "source": "a" * 64}, {"numpy": "2.1", "source": "b" * 64}, "m")


def test_folders_of_builds_that_never_ended_go(machine: Path) -> None:
    old = build_folder("a" * 32)
    os.utime(old, (1, os.stat(old).st_mtime - 2 * STALE))
    assert build_folder("c" * 32).is_dir() and not old.exists()


def test_a_folder_of_somebody_else_is_refused(machine: Path) -> None:
    (machine / f"3df-lighting-{os.getuid()}").symlink_to(machine)
    with pytest.raises(OutputError, match="expected a folder of this user"):
        own_folder()
