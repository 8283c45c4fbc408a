from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import pi
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from dataset_builder.digest import sha256_file
from dataset_builder.errors import PlanError
from dataset_builder.light_kinds import LIGHT_KINDS, LampName
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.planning.view import lights as planned
from dataset_builder.planning.view.cameras import place_camera
from dataset_builder.planning.view.emission import LUMINANCE, direct_irradiance
from dataset_builder.planning.view.exposure import expose
from dataset_builder.planning.view.lights import Stream, sky_share, source_light, target_light
from dataset_builder.planning.view.lit_view import LitView
from dataset_builder.seeding import rng
from dataset_builder.spec.camera import CameraSpec
from dataset_builder.spec.light import SourceSpec, TargetSpec
from dataset_builder.spec.render import ImageSpec
from tests.planning.scene.houses import shell, walled

BoxStage = Callable[..., Arrangement]
CHAIR = ((-0.3, -0.25, 0.0), (0.3, 0.25, 0.9))
SHELF = ((0.7, -0.5, 0.0), (1.2, 0.5, 1.8))
KINDS = get_args(LampName)


def stream_of(seed: int) -> Stream:
    return partial(rng, seed)


def lit_view(arrangement: Arrangement, seed: int = 0, dome: float = 2.0) -> LitView:
    spec = CameraSpec.model_validate({"azimuth": {"uniform": [-60, 60]}, "elevation": {"uniform": [5, 40]}})
    view = place_camera(arrangement, spec, ImageSpec(), rng(seed, "camera"), "")
    return LitView(arrangement=arrangement, cameras=[view.camera], sight=view.sight, unit=pi * dome,
                   sky=sky_share(arrangement, view.sight))


def target_spec(**more: Any) -> TargetSpec:
    plain = {"elevation": {"uniform": [10, 80]}, "distance": {"uniform": [1.2, 2.2]}, "size": {"uniform": [0.1, 0.3]},
             "temperature": {"uniform": [2500, 7500]}, "strength": {"uniform": [1, 4]}, "kinds": KINDS}
    return TargetSpec.model_validate(plain | more)


@pytest.mark.parametrize("kind", KINDS)
def test_strength_is_the_irradiance_at_the_objects_centre(kind: str, box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    plan, _ = target_light(view, target_spec(kinds=[kind], strength=3, lights=2), stream_of(4), "")
    centre = view.arrangement.centre[None]
    for light in plan.lights[:2]:
        facing = np.array([light.position]) - centre
        found = direct_irradiance(light, centre, facing / np.linalg.norm(facing))[0]
        assert found @ LUMINANCE == pytest.approx(3 * pi * 2.0 / 2)
        assert found.mean() == pytest.approx(light.weight)


@pytest.mark.parametrize("seed", range(12))
def test_lights_are_in_the_room_clear_of_things_and_within_the_brightness_asked(seed: int,
                                                                                box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR, (SHELF,)), seed)
    spec = target_spec(lights={"choice": [1, 2, 3]}, brightness=(0.3, 3))
    plan, note = target_light(view, spec, stream_of(seed), "")
    *lights, outside = plan.lights
    low, high = BoxShell(view.arrangement.room).extent
    for light in lights:
        reach = max(light.size, 0.02)
        assert (light.position >= low + reach).all() and (light.position <= high - reach).all()
        assert view.arrangement.everything.distance(np.array([light.position]))[0] >= reach - 1e-6
        assert (light.size > 0, light.cutoff > 0) == (LIGHT_KINDS[light.kind].sized, LIGHT_KINDS[light.kind].beamed)
        assert 1.2 <= np.linalg.norm(np.array(light.position) - view.arrangement.centre) <= 2.2
        if LIGHT_KINDS[light.kind].aimed:
            aim = view.arrangement.centre - np.array(light.position)
            assert light.direction == pytest.approx(aim / np.linalg.norm(aim))
    shown = expose(view.arrangement, view.sight, plan.lights, view.unit, view.sky)
    assert 0.3 <= shown.mean <= 3 and shown.lit >= 0.25 and f"{shown.mean:.2f}" in note
    assert outside.kind == "dome" and outside.weight == pytest.approx(0.02 * 0.05 * pi) and plan.open == ()


def test_emitters_do_not_come_between_camera_and_object(box_arrangement: BoxStage) -> None:
    for seed in range(6):
        view = lit_view(box_arrangement(CHAIR), seed)
        spec = target_spec(kinds=["sphere"], size=0.3, lights=4, elevation={"uniform": [-10, 40]})
        plan, _ = target_light(view, spec, stream_of(seed), "")
        camera = np.array(view.cameras[0].position)
        for light in plan.lights[:-1]:
            for share in np.linspace(0, 1, 60):
                points = camera + share * (view.sight.points - camera)
                assert np.linalg.norm(points - np.array(light.position), axis=1).min() >= 0.3 - 1e-9


def test_one_light_more_moves_no_kind_colour_or_place_of_the_others(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR))
    spec = {"brightness": (0, 1e6)}
    two, _ = target_light(view, target_spec(lights=2, **spec), stream_of(8), "")
    three, _ = target_light(view, target_spec(lights=3, **spec), stream_of(8), "")
    for a, b in zip(two.lights[:2], three.lights[:2], strict=True):
        assert (a.kind, a.position, a.size, a.temperature) == (b.kind, b.position, b.size, b.temperature)
        assert np.array(a.radiance) * 2 == pytest.approx(np.array(b.radiance) * 3)


def test_a_light_too_weak_leaves_the_object_black(box_arrangement: BoxStage) -> None:
    with pytest.raises(PlanError, match="it would stay black") as caught:
        target_light(lit_view(box_arrangement(CHAIR)), target_spec(strength=1e-3, attempts=20), stream_of(0),
                     "train/000000")
    assert str(caught.value).startswith("train/000000: target") and "target.strength" in str(caught.value)
    assert "sun" not in str(caught.value)


def test_a_sun_that_leaves_the_object_dark_is_named(box_arrangement: BoxStage) -> None:
    with pytest.raises(PlanError, match="the sun counts, too: turn it"):
        target_light(lit_view(box_arrangement(CHAIR)), target_spec(strength=1e-3, attempts=2, sun={"irradiance": 1e-4}),
                     stream_of(0), "")


def test_a_light_too_strong_blows_the_object_out(box_arrangement: BoxStage) -> None:
    with pytest.raises(PlanError, match=r"at least .* in 20 draws: it would be overexposed"):
        target_light(lit_view(box_arrangement(CHAIR)), target_spec(strength=1e4, attempts=20), stream_of(0), "")


def test_an_object_shut_off_from_every_light_stays_black(box_arrangement: BoxStage) -> None:
    """The camera is under the same hood, and no light is drawn that near."""
    arrangement = box_arrangement(CHAIR, (((-1.5, -1.5, -0.01), (1.5, 1.5, 1.1)),))
    spec = CameraSpec.model_validate({"coverage": (0.2, 0.9), "fov": 80, "clearance": 0.05, "visibility": 0.2,
                                      "elevation": 5})
    view = place_camera(arrangement, spec, ImageSpec(), rng(0), "")
    lit = LitView(arrangement=arrangement, cameras=[view.camera], sight=view.sight, unit=pi, sky=0.0)
    with pytest.raises(PlanError, match="light on 50% of it, got at most 0 and 0%"):
        target_light(lit, target_spec(distance=2.2, elevation=35, size=0.1, attempts=20), stream_of(0), "")


def test_lights_that_have_no_place_say_so(box_arrangement: BoxStage) -> None:
    view, spec = lit_view(box_arrangement(CHAIR)), target_spec(distance=50, attempts=10)
    with pytest.raises(PlanError, match=r"a free place for a light within target\.distance.* \(in the room, clear"):
        target_light(view, spec, stream_of(0), "")
    view = replace(view, arrangement=replace(view.arrangement, shell=shell(walled(5, 4, 2.5))))
    with pytest.raises(PlanError, match=r"\(in the scene, clear"):
        target_light(view, spec, stream_of(0), "")


def test_no_light_at_all_is_an_error(box_arrangement: BoxStage) -> None:
    spec = TargetSpec.model_construct(**{**dict(target_spec()), "lights": 0.0})
    with pytest.raises(PlanError, match="at least one target light, got 0"):
        target_light(lit_view(box_arrangement(CHAIR)), spec, stream_of(0), "")


def test_the_sky_reaches_an_object_in_the_open_and_none_in_a_closed_room(box_arrangement: BoxStage) -> None:
    closed = lit_view(box_arrangement(CHAIR))
    assert closed.sky == 0
    in_the_open = lit_view(box_arrangement(CHAIR, closed=False))
    assert in_the_open.sky == pytest.approx(1)


def test_the_source_is_a_dome_and_a_sun_that_shines_down() -> None:
    spec = SourceSpec.model_validate({"dome": 0.5, "sun": {"elevation": 30, "azimuth": 90, "irradiance": 2}})
    plan = source_light(spec, stream_of(0))
    dome, sun = plan.lights
    assert dome.weight == pytest.approx(0.5 * pi) == planned.unit_irradiance(plan) and dome.radiance == (0.5, 0.5, 0.5)
    assert sun.direction == pytest.approx((-np.cos(np.radians(30)), 0, -0.5), abs=1e-9) and sun.weight == 2
    assert plan.open == ("ceiling", "walls")


def test_a_source_without_light_is_an_error() -> None:
    with pytest.raises(PlanError, match="source: expected a dome or a sun above 0"):
        source_light(SourceSpec(dome=0.0), stream_of(0))


def test_an_environment_is_named_with_its_digest_and_turned(tmp_path: Path) -> None:
    (tmp_path / "sky.hdr").write_bytes(b"a sky")
    spec = SourceSpec.model_validate({"dome": 2, "environment": "sky.hdr", "turn": {"uniform": [10, 20]}})
    (dome,) = source_light(spec, stream_of(0), tmp_path).lights
    assert (dome.image, dome.image_sha256) == ("sky.hdr", sha256_file(tmp_path / "sky.hdr"))
    assert 10 <= dome.turn <= 20 and dome.radiance == (2, 2, 2) and dome.weight == pytest.approx(2 * pi)
    (tmp_path / "sky.hdr").write_bytes(b"another sky")
    (changed,) = source_light(spec, stream_of(0), tmp_path).lights
    assert changed.image_sha256 != dome.image_sha256 and changed.turn == dome.turn


@pytest.mark.parametrize(("part", "key"), [("source", "environment"), ("target", "environment"),
                                           ("target", "textures")])
def test_an_image_that_is_not_there_is_named(part: str, key: str, tmp_path: Path,
                                             box_arrangement: BoxStage) -> None:
    name = ("no.exr",) if key == "textures" else "no.exr"
    with pytest.raises(PlanError, match=rf"no\.exr: {part}\.{key}: expected an image, got: No such file") as caught:
        if part == "source":
            source_light(SourceSpec.model_validate({key: name}), stream_of(0), tmp_path)
        else:
            target_light(lit_view(box_arrangement(CHAIR)), target_spec(kinds=["area"], **{key: name}), stream_of(0), "",
                         tmp_path)
    assert str(tmp_path) in str(caught.value)


def test_area_lights_show_textures_and_other_lights_none(tmp_path: Path, box_arrangement: BoxStage) -> None:
    names = ("a.png", "b.exr")
    for name in names:
        (tmp_path / name).write_bytes(name.encode())
    spec = target_spec(lights=12, textures=names, brightness=(0, 1e6), distance={"uniform": [1.2, 1.6]}, size=0.1)
    plan, _ = target_light(lit_view(box_arrangement(CHAIR)), spec, stream_of(2), "", tmp_path)
    plain, _ = target_light(lit_view(box_arrangement(CHAIR)), spec.model_copy(update={"textures": ()}), stream_of(2),
                            "")
    assert {light.image for light in plan.lights if light.kind == "area"} == set(names)
    assert not any(light.image for light in plan.lights if light.kind != "area")
    without = [light.model_copy(update={"image": "", "image_sha256": ""}) for light in plan.lights]
    assert tuple(without) == plain.lights


def test_the_sun_counts_where_it_gets_in(box_arrangement: BoxStage) -> None:
    spec = target_spec(strength=1, sun={"elevation": 90, "irradiance": 1000}, dome=0, brightness=(0, 1e6))
    plan, note = target_light(lit_view(box_arrangement(CHAIR)), spec, stream_of(1), "")
    _, sun = plan.lights
    assert sun.kind == "sun" and sun.direction == pytest.approx((0, 0, -1)) and sun.radiance == (1000, 1000, 1000)
    assert sun.weight == pytest.approx(0.02 * 1000) and "irradiance 0." in note
    view = lit_view(box_arrangement(CHAIR, closed=False))
    shone_on, note = target_light(view, spec, stream_of(1), "")
    facing = np.maximum(view.sight.normals[:, 2], 0).mean()
    assert shone_on.lights[1].weight == pytest.approx(1000 * facing, rel=0.1) and facing > 0.02
    with pytest.raises(PlanError, match="it would be overexposed"):
        target_light(view, spec.model_copy(update={"brightness": (0.1, 20), "attempts": 5}), stream_of(1), "")


def test_many_lights_are_weighed_by_what_they_send(box_arrangement: BoxStage) -> None:
    spec = target_spec(lights=20, kinds=["point"], strength={"choice": [1, 3]}, temperature=6500, brightness=(0, 1e6))
    plan, _ = target_light(lit_view(box_arrangement(CHAIR)), spec, stream_of(5), "")
    *lamps, _ = plan.lights
    sent = [np.array(light.radiance).mean() / np.sum((np.array(light.position) - [0, 0, 0.45]) ** 2) for light in lamps]
    assert [light.weight for light in lamps] == pytest.approx(sent)
    assert max(sent) / min(sent) == pytest.approx(3)


def test_a_window_lets_sky_in_and_weighs_it(box_arrangement: BoxStage) -> None:
    view = lit_view(box_arrangement(CHAIR, closed=False))
    plan, _ = target_light(view, target_spec(dome=0.3), stream_of(1), "")
    assert plan.lights[-1].weight == pytest.approx(0.3 * pi * view.sky) and view.sky > 0.9
