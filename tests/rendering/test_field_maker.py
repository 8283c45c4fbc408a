"""Making a field: images that fit their cameras, kept as they are taken, and the same bytes however often the making
was interrupted."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.errors import UserError
from dataset_builder.geometry.raycast import RayScene
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import IlluminationPlan, LightPlan, ObjectPlan, Param
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.rendering import field_maker
from dataset_builder.rendering.field_maker import make_field
from dataset_builder.rendering.field_shelf import FieldProgress, FieldShelf, FieldTask
from dataset_builder.rendering.field_views import StudioCameras, directions, studio
from dataset_builder.rendering.kept_images import PIXELS, SUMS, KeptImages
from dataset_builder.spec.families import FAMILIES

DOME = LightPlan(kind="dome", position=(0, 0, 0), direction=(0, 0, -1), size=0, cutoff=0, radiance=(1, 1, 1),
                 temperature=0, weight=np.pi)
FIELD = FieldPlan(kind="density", views=24, held_out=4, size=32, spp=4, resolution=32, steps=110, max_depth=8, seed="7",
                  light=IlluminationPlan(lights=(DOME,), open=()))
STOOL = ObjectPlan(name="a-stool", kind="procedural", source="stool", source_sha256="", category="stool",
                   licence="CC0-1.0", seed="3", scale=1.0, up="z", params=tuple(
                       Param(name=param.name, value=float((param.low + param.high) // 2 if param.integer else
                                                          (param.low + param.high) / 2))
                       for param in FAMILIES["stool"].params))
TASK = FieldTask(object=STOOL, field=FIELD)


class Killed(BaseException):
    """The process ends here."""


def killed_at(stage: str, count: int) -> Callable[[FieldProgress], None]:
    """Whose process ends at the news number `count` of a stage."""
    heard = Counter[str]()

    def told(news: FieldProgress) -> None:
        heard[news.stage] += 1
        if heard[stage] == count:
            raise Killed
    return told


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[FieldShelf, FieldFile]:
    shelf = FieldShelf(folder=tmp_path_factory.mktemp("shelf"), made_by={"code": "1"})
    return shelf, make_field(TASK, shelf, Path())


def bytes_of(shelf: FieldShelf) -> bytes:
    return shelf.path(TASK, Path()).read_bytes()


def test_a_field_is_whole_and_nothing_else_is_left(made: tuple[FieldShelf, FieldFile]) -> None:
    shelf, file = made
    assert shelf.folder is not None and [path.name for path in shelf.folder.iterdir()] == [f"{shelf.key(TASK)}.npz"]
    assert file.record.key == shelf.key(TASK) and file.white == 1 and file.record.psnr > 15
    # It is found, not made again
    assert make_field(TASK, shelf, Path(), told=killed_at("images", 1)).record == file.record


@pytest.mark.parametrize(("stage", "count", "taken"), [("images", 10, 18), ("fit", 2, 0)])
def test_an_interrupted_making_goes_on_to_the_same_bytes(stage: str, count: int, taken: int, tmp_path: Path,
                                                         made: tuple[FieldShelf, FieldFile]) -> None:
    shelf, news = FieldShelf(folder=tmp_path, made_by=made[0].made_by), list[FieldProgress]()
    with pytest.raises(Killed):
        make_field(TASK, shelf, Path(), told=killed_at(stage, count))
    assert [path.suffix for path in tmp_path.iterdir()] == [".making"]
    make_field(TASK, shelf, Path(), told=news.append)
    assert sum(each.stage == "images" for each in news) == taken
    assert stage == "images" or min(each.step for each in news) > 36
    assert bytes_of(shelf) == bytes_of(made[0]) and len(list(tmp_path.iterdir())) == 1


def test_other_versions_make_another_field(made: tuple[FieldShelf, FieldFile]) -> None:
    assert FieldShelf(folder=made[0].folder, made_by={"code": "2"}).find(TASK, Path()) is None


def test_what_cannot_be_fitted_is_told_of_the_object_and_leaves_nothing(monkeypatch: pytest.MonkeyPatch,
                                                                        tmp_path: Path) -> None:
    def fails(*_: object, **__: object) -> FieldFile:
        raise UserError("expected a surface, got none")

    monkeypatch.setattr(field_maker, "fit_field", fails)
    with pytest.raises(UserError, match="a-stool: expected a surface, got none"):
        make_field(TASK, FieldShelf(folder=tmp_path), Path())
    assert list(tmp_path.iterdir()) == []


def test_masks_are_where_the_cameras_see_the_object() -> None:
    """Against rays of our own through the mesh, by the poses alone; a quarter of a pixel would be seen."""
    mesh, field = asset_of(STOOL, Path()).mesh, FIELD.model_copy(update={"views": 8, "held_out": 2, "spp": 64})
    cameras = StudioCameras.of(STOOL, field, Path())
    with studio(STOOL, field, cameras, Path()) as take:
        images = cameras.images(np.stack([take(number) for number in range(10)]), slice(None))
    scene = RayScene([(mesh.positions, mesh.faces, 1)])
    place = (np.arange(8 * FIELD.size) + 0.5) / 8
    for pixels, pose, focal, centre in zip(images.pixels, images.poses, images.focal, images.centre, strict=True):
        x, y = np.meshgrid(place, place)
        ways = np.stack([(x - centre[0]) / focal[0], (y - centre[1]) / focal[1], np.ones_like(x)], axis=-1)
        rays = ways.reshape(-1, 3) @ pose[:3, :3].T
        _, distance = scene.first_hit(np.broadcast_to(pose[:3, 3], rays.shape), rays)
        seen = np.isfinite(distance).reshape(FIELD.size, 8, FIELD.size, 8).mean(axis=(1, 3))
        opacity = pixels[..., 3].astype(float)
        assert np.minimum(opacity, seen).sum() > 0.95 * np.maximum(opacity, seen).sum() and opacity.sum() > 20
        assert np.linalg.det(pose[:3, :3]) == pytest.approx(1) and not pixels[0].any() and not pixels[:, -1].any()
        # A surface sends back no more than it gets, and what is behind is not in it
        assert (pixels[..., :3] <= 1.05 * pixels[..., 3:] + 1e-3).all()


def test_directions_cover_the_sphere() -> None:
    ways = directions(200, 50, 3)
    assert np.allclose(np.linalg.norm(ways, axis=1), 1) and np.abs(ways[:200].mean(axis=0)).max() < 0.01
    assert np.arccos(np.clip((ways[:200] @ ways[:200].T - 2 * np.eye(200)).max(axis=1), -1, 1)).min() > np.radians(10)
    assert np.array_equal(ways, directions(200, 50, 3)) and not np.allclose(ways[0], directions(200, 50, 4)[0])


def test_images_that_changed_on_the_disk_are_missing(tmp_path: Path) -> None:
    taken = [np.full((4, 4, 4), number, np.float16) for number in range(5)]
    assert list(KeptImages(tmp_path, 5, 4).keep(enumerate(taken))) == [1, 2, 3, 4, 5]
    again = KeptImages(tmp_path, 5, 4)
    assert again.missing() == [] and np.array_equal(again.pixels, taken)
    again.pixels[2, 0, 0, 0] = 7
    assert KeptImages(tmp_path, 5, 4).missing() == [2]
    whole = (tmp_path / SUMS).read_bytes()
    (tmp_path / SUMS).write_bytes(whole[:-9])
    assert KeptImages(tmp_path, 5, 4).missing() == [0, 1, 2, 3, 4]
    (tmp_path / SUMS).write_bytes(whole)
    content = (tmp_path / PIXELS).read_bytes()
    (tmp_path / PIXELS).write_bytes(content[:len(content) // 2])
    assert KeptImages(tmp_path, 5, 4).missing() == [2, 3, 4]
    assert KeptImages(tmp_path, 6, 4).missing() == [0, 1, 2, 3, 4, 5]
