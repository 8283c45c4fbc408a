"""Lights of a plan as Mitsuba emitters: where an environment's light comes from, and how bright an image is."""

import gc
from pathlib import Path
from typing import get_args

import drjit as dr
import mitsuba as mi
import numpy as np
import OpenEXR
import pytest

from dataset_builder.digest import sha256_file
from dataset_builder.errors import PlanError
from dataset_builder.light_kinds import LampName
from dataset_builder.planning.view.emission import LUMINANCE, direct_irradiance
from dataset_builder.rendering.scene.emitters import emitters
from dataset_builder.rendering.scene.images import environment, lamp_texture, mean_luminance, read_image
from dataset_builder.spec.image_uses import ENVIRONMENT_SUFFIXES, TEXTURE_SUFFIXES
from tests.reference_scenes import deviates, diffuse, rectangle, sensor, traced
from tests.small_scenes import light, lit_by

WIDTH, HEIGHT = 64, 32


def written(folder: Path, pixels: np.ndarray, name: str = "image.exr") -> dict[str, str]:
    """Fields of a light that shows `pixels`, saved as a file."""
    pixels = np.ascontiguousarray(pixels, dtype=np.float32)
    if name.endswith(".exr"):
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"RGB": pixels}).write(str(folder / name))
    else:
        mi.Bitmap(pixels).write(str(folder / name))
    return {"image": name, "image_sha256": sha256_file(folder / name)}


def sky_light(folder, pixels, turn=0.0, name="image.exr"):
    return light("dome", (1.0, 1.0, 1.0), turn=turn, **written(folder, pixels, name))


def radiance_from(emitters, direction):
    """What a ray along `direction` sees of lights and nothing else."""
    scene = mi.load_dict({"type": "scene", **emitters})
    ray = mi.Ray3f(mi.Point3f(0, 0, 0), mi.Vector3f(*direction))
    si = scene.ray_intersect(ray)
    return np.array(si.emitter(scene).eval(si))[:, 0]


def spot_of_sky(column: float, row: float) -> np.ndarray:
    """A dark sky with a bright patch about a share of its width and height."""
    pixels = np.full((HEIGHT, WIDTH, 3), 0.01)
    pixels[int(row * HEIGHT) - 2:int(row * HEIGHT) + 2, int(column * WIDTH) - 2:int(column * WIDTH) + 2] = (9, 6, 3)
    return pixels


def mean_over_sphere(pixels: np.ndarray) -> float:
    """Mean luminance of a latitude-longitude image whose rows lie from pole to pole, by fine steps between them."""
    steps = (np.arange(100_000) + 0.5) / 100_000
    rows = np.interp(steps * (len(pixels) - 1), np.arange(len(pixels)), (pixels @ LUMINANCE).mean(axis=1))
    return float(np.average(rows, weights=np.sin(np.pi * steps)))


@pytest.mark.parametrize(("column", "row", "turn", "direction"), [
    (0.5, 0.5, 0, (1, 0, 0)), (0.25, 0.5, 0, (0, 1, 0)), (0.75, 0.5, 0, (0, -1, 0)), (0.5, 0.25, 0, (1, 0, 1)),
    (0.5, 0.75, 0, (1, 0, -1)), (0.5, 0.5, 90, (0, 1, 0)), (0.25, 0.5, 90, (-1, 0, 0)), (0.5, 0.25, -90, (0, -1, 1))])
def test_an_environment_stands_upright_and_turns_from_x_to_y(tmp_path, column, row, turn, direction):
    pixels = spot_of_sky(column, row)
    made, mean = emitters(lit_by(sky_light(tmp_path, pixels, turn)), tmp_path), mean_over_sphere(pixels)
    towards = np.array(direction) / np.linalg.norm(direction)
    assert radiance_from(made, towards.tolist()) == pytest.approx(np.array([9, 6, 3]) / mean, rel=1e-3)
    assert radiance_from(made, (-towards).tolist()) == pytest.approx([0.01 / mean] * 3, rel=1e-3)


def test_an_environment_lights_the_side_that_it_is_bright_on(tmp_path):
    """Along -X a wall faces a bright patch at +X; turned by half it gets next to nothing."""
    def lighting(turn):
        wall = rectangle((0, 0, 0), (1, 0, 0), 4, bsdf=diffuse(0.5))
        made = emitters(lit_by(sky_light(tmp_path, spot_of_sky(0.5, 0.5), turn)), tmp_path)
        scene = mi.load_dict({"type": "scene", "wall": wall, **made})
        return traced(scene, sensor((3, 0.1, 0.1)), 16, 3, max_depth=2)["shading"]

    # S is L / pi times the integrals of cos over azimuth and of cos^2 over height, where rows lie from pole to pole
    aside, above = 2 * 2 * np.pi / WIDTH, 2 * np.pi / (HEIGHT - 1)
    share, mean = 2 * np.sin(aside) * (above + np.sin(2 * above) / 2) / np.pi, mean_over_sphere(spot_of_sky(0.5, 0.5))
    assert lighting(0).mean(axis=(0, 1, 2)) == pytest.approx((0.01 + share * np.array([9, 6, 3])) / mean, rel=0.02)
    assert lighting(180).mean() == pytest.approx(0.01 / mean, rel=0.03)


def test_an_even_image_is_a_plain_dome(tmp_path):
    def shading(dome):
        ball = {"type": "sphere", "bsdf": diffuse(0.5)}
        scene = mi.load_dict({"type": "scene", "ball": ball, **emitters(lit_by(dome), tmp_path)})
        return traced(scene, sensor((0, -4, 0), fov=10), 64, 3)["shading"]

    colour = np.array([0.4, 0.5, 0.6])
    shown = light("dome", (2.0, 2.0, 2.0), **written(tmp_path, np.broadcast_to(colour, (HEIGHT, WIDTH, 3))))
    assert not deviates(shading(shown).mean(axis=(1, 2)), 2 * colour / (colour @ LUMINANCE))


@pytest.mark.parametrize("exposure", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(("column", "row", "shape"), [(0.5, 0.1, (HEIGHT, WIDTH)), (0.2, 0.5, (20, 50))])
def test_a_dome_sends_its_radiance_whatever_it_shows(tmp_path, column, row, shape, exposure):
    """The mean luminance over all directions, and the weight, are those of an even dome: even near a pole."""
    pixels = exposure * spot_of_sky(column, row)[:shape[0], :shape[1]]
    made = emitters(lit_by(light("dome", (2.0, 2.0, 2.0), weight=5.0, **written(tmp_path, pixels))), tmp_path)
    up, around = np.meshgrid((np.arange(4000) + 0.5) / 2000 - 1, 2 * np.pi * (np.arange(256) + 0.5) / 256)
    aside = np.sqrt(1 - up ** 2)
    sky = mi.load_dict(made["dome_0"])
    si = dr_interaction(np.stack([aside * np.cos(around), aside * np.sin(around), up]).reshape(3, -1))
    assert np.array(sky.eval(si)).T.mean(axis=0) @ LUMINANCE == pytest.approx(2, rel=1e-3)
    assert made["dome_0"]["sampling_weight"] == 5


def dr_interaction(directions):
    """Interactions of rays along `directions` (3, N) that left the scene."""
    si = dr.zeros(mi.SurfaceInteraction3f, directions.shape[1])
    si.wi = -mi.Vector3f(directions.astype(np.float32))
    return si


@pytest.mark.parametrize("size", [(16, 16), (40, 100)])
def test_a_textured_lamp_is_as_bright_from_afar_as_a_plain_one(tmp_path, size):
    def shading(**image):
        lamp = light("area", (30, 20, 10), position=(0.0, 0.0, 6.0), direction=(0.0, 0.0, -1.0), size=0.4, **image)
        floor = rectangle((0, 0, 0), (0, 0, 1), 4, bsdf=diffuse(0.5))
        scene = mi.load_dict({"type": "scene", "floor": floor, **emitters(lit_by(lamp, light("area", (0, 0, 0),
                              position=(3, 3, 3), weight=0.0)), tmp_path)})
        return traced(scene, sensor((0, -2, 2), fov=3), 64, 3, max_depth=2)["shading"].mean(axis=(1, 2))

    grey = np.random.default_rng(5).gamma(0.4, 1.0, size)[..., None] * np.ones(3)
    shown, plain = shading(**written(tmp_path, grey)), shading()
    assert not deviates(shown, plain.mean(axis=0))
    assert plain.mean(axis=0) == pytest.approx(np.array([30, 20, 10]) * 0.16 / 36 / np.pi, rel=0.01)


DOWN = {"direction": (0.0, 0.0, -1.0)}


@pytest.mark.parametrize(("kind", "more"), [
    *((kind, DOWN) for kind in get_args(LampName)), ("area", {**DOWN, "length": 1.5, "turn": 30.0}), ("disk", DOWN),
    ("cylinder", {"direction": (0.6, 0.8, 0.0), "length": 1.5}), ("spot", {**DOWN, "beam": 39.0})],
    ids=lambda value: value if isinstance(value, str) else "-".join(map(str, value)))
def test_a_lamp_sends_what_planning_reckons(kind, more):
    lamp = light(kind, (30, 20, 10), position=(0.0, 0.0, 6.0), size=0.4, **more)
    floor = rectangle((0, 0, 0), (0, 0, 1), 4, bsdf=diffuse(0.5))
    scene = mi.load_dict({"type": "scene", "floor": floor, **emitters(lit_by(lamp))})
    found = traced(scene, sensor((0, -2, 2), fov=3), 64, 3, max_depth=2)["shading"].mean(axis=(0, 1, 2))
    expected = direct_irradiance(lamp, np.zeros((1, 3)), np.array([[0.0, 0.0, 1.0]]))[0] / np.pi
    assert found == pytest.approx(expected, rel=0.01)


def test_another_image_needs_no_new_kernel(tmp_path):
    rng = np.random.default_rng(6)

    def render(seed, width):
        gc.collect()
        pixels = [rng.random((width // 2, width, 3)) for _ in range(2)]
        dome = sky_light(tmp_path, pixels[0], 20.0 * seed, f"sky{seed}.exr")
        lamp = light("area", **written(tmp_path, pixels[1], f"lamp{seed}.exr"))
        scene = mi.load_dict({"type": "scene", "ball": {"type": "sphere", "bsdf": diffuse(0.5)},
                              **emitters(lit_by(dome, lamp), tmp_path)}, parallel=False)
        traced(scene, sensor(), 1, 3)

    render(0, 64)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        render(1, 50)
        big = [kernel for kernel in dr.kernel_history() if kernel.get("operation_count", 0) > 1000]
    assert len(big) == 1 and big[0]["cache_hit"]


def test_images_are_read_as_linear_light(tmp_path):
    from PIL import Image

    Image.new("RGB", (4, 2), (0, 188, 255)).save(tmp_path / "a.png")
    found = read_image(tmp_path / "a.png", sha256_file(tmp_path / "a.png"), TEXTURE_SUFFIXES)
    assert found.shape == (2, 4, 3) and found[0, 0] == pytest.approx([0, 0.5029, 1], abs=1e-4)
    hdr = np.array([[[100.0, 1.0, 0.25], [0.0, 2.0, 8.0]]])
    fields = written(tmp_path, hdr, "b.hdr")
    read = read_image(tmp_path / "b.hdr", fields["image_sha256"], ENVIRONMENT_SUFFIXES)
    assert read == pytest.approx(hdr, rel=0.02, abs=0.5)


def test_sizes_are_few_and_means_are_kept():
    rng = np.random.default_rng(8)
    assert {environment(rng.random((n // 2, n, 3))).shape for n in (10, 64, 65, 128)} == {(32, 64, 3), (64, 128, 3)}
    texture = lamp_texture(rng.random((30, 300, 3)) * [1, 2, 3])
    assert texture.shape == (256, 256, 3)
    assert texture.mean(axis=(0, 1)) @ [0.2126, 0.7152, 0.0722] == pytest.approx(1, rel=1e-3)
    for sky in (rng.random((32, 64, 3)) ** 9, rng.random((30, 300, 3)) * 1e6):
        assert mean_over_sphere(environment(sky)) == pytest.approx(1, rel=1e-4)
    half = np.zeros((64, 8, 3))
    half[:32] = 3
    assert mean_luminance(half) == pytest.approx(1.5)


@pytest.mark.parametrize(("value", "said"), [(np.nan, "got nan in 1 places"), (np.inf, "got inf"), (-1, "got -1")])
def test_values_that_no_light_has_are_refused(tmp_path, value, said):
    pixels = np.ones((4, 8, 3))
    pixels[1, 2, 0] = value
    with pytest.raises(PlanError, match=rf"image\.exr: expected finite values of at least 0, {said}"):
        emitters(lit_by(sky_light(tmp_path, pixels)), tmp_path)


def test_files_that_are_not_as_planned_are_refused(tmp_path):
    def refused(said, **more):
        fields = written(tmp_path, np.ones((4, 8, 3))) | more
        with pytest.raises(PlanError, match=said):
            emitters(lit_by(light("dome", **fields)), tmp_path)

    refused("expected content of SHA-256 0, got", image_sha256="0")
    refused("gone.exr: expected a readable file, got: No such file", image="gone.exr")
    refused("expected a file of kind .exr .hdr, got .png", image="a.png")
    (tmp_path / "broken.exr").write_bytes(b"no image")
    refused("broken.exr: expected an image of colours, got", image="broken.exr",
            image_sha256=sha256_file(tmp_path / "broken.exr"))
    with pytest.raises(PlanError, match=r"expected a file of kind \.exr \.png, got \.hdr"):
        emitters(lit_by(light("area", image="a.hdr")), tmp_path)
    with pytest.raises(PlanError, match="expected the folder of the image"):
        emitters(lit_by(light("dome", image="a.exr")))


@pytest.mark.parametrize("kind", ["dome", "area"])
def test_black_images_are_refused(tmp_path, kind):
    with pytest.raises(PlanError, match=r"night\.exr: expected an image with a value above 0, got a black one"):
        emitters(lit_by(light(kind, **written(tmp_path, np.zeros((4, 8, 3)), "night.exr"))), tmp_path)


def test_no_light_and_too_many_are_refused():
    with pytest.raises(PlanError, match="at least one with a radiance above 0"):
        emitters(lit_by(light("dome", (0, 0, 0))))
    with pytest.raises(PlanError, match="at most 1 of kind dome, got 2"):
        emitters(lit_by(light("dome"), light("dome")))
