"""Render a small scene as the product does, several times, and compare the pictures with laws and formulas."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.ndimage import maximum_filter, minimum_filter

from dataset_builder.geometry.pinhole import Pinhole, unit
from dataset_builder.label.example_plan import RenderPlan, Transport
from dataset_builder.label.scene_plan import CameraPlan, IlluminationPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.rendering import passes
from dataset_builder.rendering.scene.local_frame import LocalFrame
from dataset_builder.rendering.scene.open_scene import body_of, open_scene
from dataset_builder.rendering.scene.triangle_soup import Soup
from dataset_builder.studies.stress.case import CaseMeasured, Size

BATCHES = 4
SEED = 5
ROUNDING = 1e-5
"""What float32 sums and products may be off by, relative."""

HOMOGENEOUS = 1e-3
"""Difference of D between neighbouring pixels below which I = D S must hold for the pixel's means."""

TURNED = 0.01
"""Cosine by which a mean normal may look away from the ray through the middle of its pixel."""

SUBPIXELS = 8
"""Rays along each side of a pixel, for means of formulas over it."""


@dataclass(frozen=True, kw_only=True)
class Shot:
    """How a scene is looked at."""

    camera: CameraPlan
    size: tuple[int, int] | None = None
    """Width and height where they are not the square of the run."""
    max_depth: int = 6
    seed: int = SEED
    framed: bool = False
    """Whether the scene is moved and scaled as the product does it."""
    replicas: int | None = None
    spp: int | None = None
    batches: int = BATCHES


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """All layers of one shot."""

    image: np.ndarray
    """(K, H, W, 3) of K independent renders, as are shading and specular."""
    shading: np.ndarray
    specular: np.ndarray
    mask: np.ndarray
    """(H, W), as is depth."""
    depth: np.ndarray
    d: np.ndarray
    """(H, W, 3), as are r and normal."""
    r: np.ndarray
    normal: np.ndarray
    facing: np.ndarray
    """(H, W) cosine between the normal and the way to the viewer."""
    same: np.ndarray
    """(H, W) whether a surface of one D fills the pixel and all of its neighbours."""

    @property
    def s(self) -> np.ndarray:
        """(H, W, 3) mean shading."""
        return self.shading.mean(axis=0)

    @property
    def i(self) -> np.ndarray:
        """(H, W, 3) mean image."""
        return self.image.mean(axis=0)


def render(soup: Soup, illumination: IlluminationPlan, shot: Shot, size: Size) -> Picture:
    """All layers of one shot."""
    frame = LocalFrame.of(soup.corners[soup.instance == 1]) if shot.framed else LocalFrame()
    width, height = shot.size or (size.side, size.side)
    view = passes.ViewSensor(camera=frame.camera(shot.camera), render=_render_plan(width, height, shot.batches))
    pixels, replicas = np.arange(width * height), shot.replicas or size.replicas
    with open_scene(body_of(frame.soup(soup)), frame.illumination(illumination)) as opened:
        first = passes.first_hit(view, opened, pixels, size.spp, shot.batches, shot.seed)
        found = passes.radiance(view, opened, np.tile(pixels, replicas), max_depth=shot.max_depth,
                                spp=shot.spp or size.spp, seed=shot.seed, transport=_transport(illumination, size))
    light = {name: found.mean[:, channels].reshape(replicas, height, width, 3)
             for name, channels in passes.RADIANCE_CHANNELS.items() if name in ("image", "shading", "specular")}
    layers = {name: values.reshape(height, width, -1) for name, values in passes.first_hit_layers(first).items()}
    filled = (first.mean[:, passes.FIRST_HIT_CHANNELS["met"]] > 1 - ROUNDING).reshape(height, width)
    return Picture(**light, mask=layers["mask"][..., 0], depth=layers["depth"][..., 0] * frame.unit, d=layers["d"],
                   r=layers["r"], normal=layers["normal"], facing=_facing(shot.camera, layers["normal"]),
                   same=minimum_filter(filled, size=3, mode="nearest") & _alike(layers["d"]))


def _transport(illumination: IlluminationPlan, size: Size) -> Transport:
    lamps = (light for light in illumination.lights if not LIGHT_KINDS[light.kind].outside)
    return size.transport if any(light.weight > 0 and any(light.radiance) for light in lamps) else "camera"


def _facing(camera: CameraPlan, normal: np.ndarray) -> np.ndarray:
    """(H, W) cosine between normals (H, W, 3) and the way from the middle of their pixels to the viewer."""
    height, width = normal.shape[:2]
    return -np.einsum("hwi,hwi->hw", normal, _rays(camera, (width, height), 1)[:, 0, :, 0])


def _alike(d: np.ndarray) -> np.ndarray:
    """(H, W) bool: D (H, W, 3) has one value over the pixel and its eight neighbours, so that no edge is in it."""
    high, low = (extreme(d, size=(3, 3, 1), mode="nearest") for extreme in (maximum_filter, minimum_filter))
    return (high - low < HOMOGENEOUS).all(axis=-1)


def _render_plan(width: int, height: int, batches: int) -> RenderPlan:
    return RenderPlan(width=width, height=height, layers=(("i_t", "frame"),), spp_first_hit=batches,
                      spp_source=batches, spp_target=batches, spp_rough=batches, batches=batches, rr_depth=5, seed="0")


def judged(picture: Picture, figure: float, *, diffuse: bool = True, where: np.ndarray | None = None,
           also: tuple[str, ...] = ()) -> CaseMeasured:
    """The figure of a radiometric case, with the laws that every picture must keep on the pixels (H, W) `where`."""
    return CaseMeasured(figure=float(figure), wrong=(*broken_laws(picture, diffuse=diffuse, where=where), *also))


def broken_laws(picture: Picture, *, diffuse: bool, where: np.ndarray | None = None) -> tuple[str, ...]:
    """Finite everywhere; I, S, D and R never negative; surfaces turned to the viewer; in diffuse scenes I = D S, and
    nothing else, to rounding."""
    layers = {name: getattr(picture, name) for name in ("image", "shading", "specular", "mask", "depth", "d", "r",
                                                        "normal")}
    wrong = [f"{name}: expected finite values, got {bad} that are not" for name, values in layers.items()
             if (bad := int(np.count_nonzero(~np.isfinite(values))))]
    wrong += [f"{name}: expected no negative value, got {values.min():g}" for name, values in layers.items()
              if name in ("image", "shading", "d", "r") and (values < 0).any()]
    if (away := float(picture.facing[picture.same].min(initial=0.0))) < -TURNED:
        wrong.append(f"normal: expected it on the viewer's side, got a cosine of {away:g}")
    if diffuse and not wrong:
        on = picture.same if where is None else picture.same & where
        off = np.abs(picture.image - picture.d * picture.shading)[:, on]
        largest = float(picture.shading[:, on].max(initial=0.0))
        if on.any() and off.max() > (allowed := (HOMOGENEOUS + ROUNDING) * largest):
            wrong.append(f"I = D S: expected a difference of at most {allowed:g}, got {off.max():g}")
    return tuple(wrong)


def sigmas(values: np.ndarray, expected: np.ndarray, *, where: np.ndarray | None = None,
           pixels: bool = True) -> float:
    """The worst deviation of replicas (K, H, W, 3) from `expected` (H, W, 3), over pixels and of the whole picture.

    Student's t over the replicas, turned into the standard normal deviate of the same tail. What float32 rounding does
    counts as an error, so that noise-free pixels can be judged too. Infinite where the whole picture is so noisy that a
    tenth of its brightness would not be seen.
    """
    where = np.ones(expected.shape[:2], bool) if where is None else where
    if not where.any():
        return np.inf
    picked, truth = values[:, where].mean(axis=-1), expected[where].mean(axis=-1)
    whole, level = picked.mean(axis=1), float(truth.mean())
    if whole.std(ddof=1) / np.sqrt(len(whole)) > 0.02 * level:
        return np.inf
    worst = _deviate(whole[:, None], np.array([level]), level)[0]
    return float(max(worst, _deviate(picked, truth, level).max()) if pixels else worst)


def _deviate(values: np.ndarray, expected: np.ndarray, level: float) -> np.ndarray:
    count = len(values)
    error = np.hypot(values.std(axis=0, ddof=1) / np.sqrt(count), 10 * ROUNDING * level)
    tail = stats.t.logsf(np.abs(values.mean(axis=0) - expected) / error, count - 1)
    return np.where(np.isfinite(tail), -stats.norm.ppf(np.exp(tail)), np.inf)


def off_by(values: np.ndarray, expected: np.ndarray | float, where: np.ndarray | None = None) -> float:
    """Largest |values - expected| on the pixels `where`, in units of the largest expected value there; infinite for no
    pixels."""
    expected = np.broadcast_to(expected, values.shape)
    if where is not None:
        values, expected = values[..., where, :], expected[..., where, :]
    return float(np.abs(values - expected).max() / np.abs(expected).max()) if values.size else np.inf


def over_pixels(camera: CameraPlan, size: tuple[int, int],
                formula: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    """(H, W) means over pixels of a formula of ray origin (3,) and unit directions (..., 3)."""
    return formula(np.array(camera.position), _rays(camera, size, SUBPIXELS)).mean(axis=(1, 3))


def _rays(camera: CameraPlan, size: tuple[int, int], side: int) -> np.ndarray:
    """(H, side, W, side, 3) unit directions through a grid of `side` by `side` points of each pixel."""
    frame, step = Pinhole.of(camera, *size), (np.arange(side) + 0.5) / side
    columns, rows = (np.arange(count)[:, None] + step for count in size)
    return unit(frame.directions(columns[None, None], rows[:, :, None, None]))


def on_floor(camera: CameraPlan, size: tuple[int, int], formula: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """(H, W, 3) grey means over pixels of a formula of points (..., 3) on the floor z = 0, which fills the picture."""
    grey = over_pixels(camera, size, lambda eye, rays: formula(eye - rays * (eye[2] / rays[..., 2:])))
    return np.repeat(grey[..., None], 3, axis=-1)


def clear_of(camera: CameraPlan, size: tuple[int, int], centre: tuple[float, float, float],
             radius: float) -> np.ndarray:
    """(H, W) bool: no ray of the pixel comes within half a pixel of a sphere."""
    def near(eye: np.ndarray, rays: np.ndarray) -> np.ndarray:
        to_centre = np.array(centre) - eye
        along = rays @ to_centre
        margin = radius + along * np.tan(np.radians(camera.fov) / 2) / size[0]
        return (to_centre @ to_centre - along**2 < margin**2) & (along > 0)
    return over_pixels(camera, size, near) == 0


def at(shot: Shot, size: Size) -> tuple[int, int]:
    """Width and height of a shot."""
    return shot.size or (size.side, size.side)


def moved(soup: Soup, scale: float, offset: np.ndarray) -> Soup:
    """A soup, scaled about the origin and then moved."""
    return replace(soup, corners=soup.corners * scale + offset)
