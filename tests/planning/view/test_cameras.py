from collections.abc import Callable
from math import atan, degrees, radians, tan
from typing import Any

import numpy as np
import pytest

from dataset_builder.errors import PlanError
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.scene_plan import CameraPlan, RoomPlan
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.planning.view.cameras import narrow_views, place_camera, towards
from dataset_builder.planning.view.visibility import look, rays, silhouette_area, window_share
from dataset_builder.seeding import rng
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.render import ImageSpec
from tests.plans import example_plan, object_plan

BoxStage = Callable[..., Arrangement]
CHAIR = ((-0.3, -0.25, 0.0), (0.3, 0.25, 0.9))
AROUND = {"azimuth": {"uniform": [-180, 180]}, "elevation": {"uniform": [5, 40]}, "fov": {"uniform": [35, 60]}}


def camera_spec(**more: Any) -> CameraSpec:
    return CameraSpec.model_validate(AROUND | more)


def frame_of(camera: CameraPlan, image: ImageSpec) -> Pinhole:
    return Pinhole.of(camera, image.width, image.height)


@pytest.mark.parametrize("size", [(160, 120), (96, 192), (64, 64)])
def test_cameras_keep_every_bound_when_measured_again_finely(size: tuple[int, int],
                                                             box_arrangement: BoxStage) -> None:
    arrangement, image = box_arrangement(CHAIR, (((0.6, -0.3, 0.0),
                                                  (1.1, 0.4, 1.2)),)), ImageSpec(width=size[0], height=size[1])
    spec = camera_spec(coverage=(0.1, 0.4), visibility=0.7, clearance=0.2)
    for k in range(12):
        camera = place_camera(arrangement, spec, image, rng(1, "camera", k), "").camera
        sight = look(arrangement, frame_of(camera, image), grid=192)
        assert sight.coverage == pytest.approx(camera.coverage, rel=0.08)
        assert 0.1 * 0.95 <= sight.coverage <= 0.4 * 1.05 and sight.visibility >= 0.7 - 0.03
        low, high = BoxShell(arrangement.room).extent
        assert (camera.position > low).all() and (camera.position < high).all()
        assert arrangement.everything.distance(np.array([camera.position]))[0] >= 0.2 - 1e-5


def test_coverages_fill_the_range(box_arrangement: BoxStage, room_of: Callable[..., RoomPlan]) -> None:
    arrangement = box_arrangement(CHAIR, room=room_of(20.0, 20.0, 15.0))
    drawn = [place_camera(arrangement, camera_spec(coverage=(0.05, 0.35)), ImageSpec(), rng(2, k), "").camera.coverage
             for k in range(40)]
    assert min(drawn) < 0.1 and max(drawn) > 0.3 and np.mean(drawn) == pytest.approx(0.2, abs=0.05)


def test_azimuth_zero_is_in_front_of_a_turned_object(box_arrangement: BoxStage) -> None:
    spec = CameraSpec.model_validate({"azimuth": 0, "elevation": 10, "fov": 40})
    camera = place_camera(box_arrangement(CHAIR, yaw=90.0), spec, ImageSpec(), rng(0), "").camera
    assert camera.position[0] > 0.8 and abs(camera.position[1]) < 1e-6


def test_directions() -> None:
    assert towards(0, 0) == pytest.approx([0, -1, 0]) and towards(90, 0) == pytest.approx([1, 0, 0])
    assert towards(123, 90) == pytest.approx([0, 0, 1])


def test_a_room_too_small_for_the_coverage_says_so(box_arrangement: BoxStage,
                                                   room_of: Callable[..., RoomPlan]) -> None:
    arrangement = box_arrangement(((-1.2, -1.2, 0.0), (1.2, 1.2, 1.5)), room=room_of(3.0, 3.0, 2.5))
    with pytest.raises(PlanError, match=r"none in 200 draws: \d+ outside the room at any coverage") as caught:
        place_camera(arrangement, camera_spec(coverage=(0.05, 0.1)), ImageSpec(), rng(0), "train/000001 (bed)")
    assert "widen `fov`" in str(caught.value) and str(caught.value).startswith("train/000001 (bed): camera")


def test_an_object_in_a_closed_box_can_never_be_seen(box_arrangement: BoxStage) -> None:
    arrangement = box_arrangement(CHAIR, (((-0.4, -0.4, -0.01), (0.4, 0.4, 1.0)),))
    with pytest.raises(PlanError, match="hidden or cut by the frame") as caught:
        place_camera(arrangement, camera_spec(attempts=40), ImageSpec(), rng(0), "")
    assert "camera.visibility" in str(caught.value) and "in 40 draws" in str(caught.value)


def test_an_object_of_which_nothing_is_seen_is_refused_even_where_no_share_is_asked(box_arrangement: BoxStage) -> None:
    arrangement = box_arrangement(CHAIR, (((-0.4, -0.4, -0.01), (0.4, 0.4, 1.0)),))
    with pytest.raises(PlanError, match="hidden or cut by the frame"):
        place_camera(arrangement, camera_spec(attempts=20, visibility=0, coverage=(0, 0.5)), ImageSpec(), rng(0), "")


def test_clearance_that_no_place_has_says_so(box_arrangement: BoxStage) -> None:
    with pytest.raises(PlanError, match=r"clearance >= 1\.5 m"):
        place_camera(box_arrangement(CHAIR), camera_spec(clearance=1.5, attempts=30), ImageSpec(), rng(0), "")


def test_a_square_in_front_covers_what_geometry_says(box_arrangement: BoxStage) -> None:
    """A thin unit square, 2 m away, in a frame of 90 degrees: 1 / 16 of a square frame, 1 / 8 of one half as high."""
    arrangement = box_arrangement(((-0.5, -1e-3, 0.5), (0.5, 1e-3, 1.5)), closed=False)
    for height, share in ((64, 1 / 16), (32, 1 / 8)):
        frame = Pinhole(position=np.array([0.0, -2.001, 1.0]), target=np.array([0.0, 0.0, 1.0]), fov=90.0,
                        width=64, height=height)
        sight = look(arrangement, frame, grid=192)
        assert sight.coverage == pytest.approx(share, rel=0.03) and sight.visibility == 1
        assert sight.normals == pytest.approx(np.tile([0.0, -1.0, 0.0], (len(sight.points), 1)))
        assert sight.points[:, 1] == pytest.approx(np.full(len(sight.points), -1e-3), abs=1e-5)
        assert window_share(arrangement, frame) == pytest.approx(share, rel=0.01)


def test_hidden_and_cut_halves_count_as_not_visible(box_arrangement: BoxStage) -> None:
    square = ((-0.5, -1e-3, 0.5), (0.5, 1e-3, 1.5))
    screened = box_arrangement(square, (((-0.5, -0.1, 0.5), (0.0, -0.05, 1.5)),), closed=False)
    ahead = Pinhole(position=np.array([0.0, -30.0, 1.0]), target=np.array([0.0, 0.0, 1.0]), fov=3.0, width=64,
                    height=64)
    assert look(screened, ahead, grid=128).visibility == pytest.approx(0.5, abs=0.02)
    aside = Pinhole(position=np.array([0.0, -30.0, 1.0]), target=np.array([30 * tan(radians(1.5)), 0.0, 1.0]), fov=3.0,
                    width=64, height=64)
    assert look(box_arrangement(square, closed=False), aside, grid=128).visibility == pytest.approx(0.5, abs=0.02)


def test_the_silhouette_of_a_box_is_its_face(box_arrangement: BoxStage) -> None:
    arrangement = box_arrangement(CHAIR)
    assert silhouette_area(arrangement, np.array([0.0, -1.0, 0.0])) == pytest.approx(0.6 * 0.9, rel=0.06)
    assert silhouette_area(arrangement, np.array([1.0, 0.0, 0.0])) == pytest.approx(0.5 * 0.9, rel=0.06)


def test_pixels_of_the_frame_span_its_field_of_view() -> None:
    frame = Pinhole(position=np.zeros(3), target=np.array([0.0, 1.0, 0.0]), fov=80.0, width=64, height=32)
    directions, inside = rays(frame, margin=2)
    x, z = (directions[:, k] / directions[:, 1] for k in (0, 2))
    assert degrees(atan(np.abs(x[inside]).max())) == pytest.approx(40, abs=1)
    assert np.abs(z[inside]).max() == pytest.approx(tan(radians(40)) / 2, rel=0.04)
    assert inside.mean() == pytest.approx(0.25)


def planned_views(spec: CameraSpec, arrangement: Arrangement, count: int,
                  name: str = "train-box-00") -> list[ExamplePlan]:
    target = arrangement.target.model_copy(update={"object": object_plan(name, "box")})
    return [example_plan(k).model_copy(update={
        "target": target, "camera": place_camera(arrangement, spec, ImageSpec(), rng(4, name, k), "").camera})
        for k in range(count)]


def test_views_from_one_side_are_told(box_arrangement: BoxStage) -> None:
    """Whichever way the object is turned: what counts is the side that is seen."""
    frontal = CameraSpec.model_validate({"azimuth": 20, "elevation": 15})
    turned = [planned_views(frontal, box_arrangement(CHAIR, yaw=yaw), 2)[k] for k, yaw in enumerate((0.0, 140.0))]
    views = [*turned, *planned_views(frontal, box_arrangement(CHAIR, yaw=90.0), 4)]
    sentence, = narrow_views(views)
    assert sentence.startswith("6 views of train-box-00 are all within ") and "`camera.azimuth`" in sentence
    assert not narrow_views(views[:2])
    others = planned_views(CameraSpec(), box_arrangement(CHAIR), 6, "train-box-01")
    assert not narrow_views(others) and narrow_views([*views, *others]) == [sentence]


def test_objects_of_few_views_are_told_together(box_arrangement: BoxStage) -> None:
    frontal = CameraSpec.model_validate({"azimuth": 0, "elevation": 15})
    views = [planned_views(frontal, box_arrangement(CHAIR), 1, f"train-box-{k:02d}")[0] for k in range(4)]
    assert narrow_views(views)[0].startswith("4 views of each of 4 objects are all within")


def test_cameras_go_round_the_object_unless_told_otherwise(box_arrangement: BoxStage) -> None:
    views = planned_views(CameraSpec(), box_arrangement(CHAIR), 40)
    ways = np.array([np.subtract(view.camera.position, view.camera.target) for view in views])
    quarters = {(x > 0, y > 0) for x, y, _ in ways}
    rises = np.degrees(np.arcsin(ways[:, 2] / np.linalg.norm(ways, axis=1)))
    assert len(quarters) == 4 and rises.min() > -5 and rises.max() < 55 and np.ptp(rises) > 25
