"""What cannot be rendered or stored is refused with a reason, and never silently corrected."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from dataset_builder.assets.asset import MORE_MAPS, Material, Texture
from dataset_builder.errors import UserError
from dataset_builder.geometry.repair import repair
from dataset_builder.geometry.rough_base import displace
from dataset_builder.geometry.subdivision import split_long_edges
from dataset_builder.label.scene_plan import IlluminationPlan
from dataset_builder.planning.view.lights import source_light
from dataset_builder.rendering.scene.emitters import emitters
from dataset_builder.rendering.surface.texels import pack
from dataset_builder.seeding import derive_seed, rng
from dataset_builder.shards.exr import encode
from dataset_builder.shards.identities import check_layers, identity_table, storable
from dataset_builder.spec.light import SourceSpec
from dataset_builder.studies.stress.case import Case, CaseMeasured, Size, hard_case
from dataset_builder.studies.stress.scenes import bare, box_mesh, light, lit_by

TAKEN = "inputs that are taken, or refused without a reason"
KEY = "00000000"
COLOURED = ("emission", "sheen")
"""Maps with three channels, besides the base colour."""


def taken(attempts: Mapping[str, Callable[[], object]], *, says: str = "expected",
          error: type[Exception] = UserError) -> CaseMeasured:
    """How many of some attempts are not refused by an error whose text holds `says`; `wrong` names them."""
    wrong = []
    for name, attempt in attempts.items():
        try:
            attempt()
        except error as refusal:
            if says not in str(refusal):
                wrong.append(f"{name}: expected a reason with {says!r}, got {refusal}")
        else:
            wrong.append(f"{name}: expected to be refused, was taken")
    return CaseMeasured(figure=len(wrong), wrong=tuple(wrong))


@hard_case(name="refused/no-light", bound=0.0, figure=TAKEN,
           expectation="a scene without light is refused at planning, and again before it is rendered",
           failure="an example of black layers, or a division by the lights' weights, which are 0")
def no_light(size: Size) -> CaseMeasured:
    """No lights, lights of no radiance, lights that are never sampled."""
    dark: dict[str, IlluminationPlan] = {
        "no lights": lit_by(), "no radiance": lit_by(light("point", 0.0)), "no weight": lit_by(light("dome", weight=0))}
    attempts: dict[str, Callable[[], object]] = {name: partial(emitters, plan) for name, plan in dark.items()}
    spec = SourceSpec.model_validate({"dome": 0.0})
    attempts["a spec with neither dome nor sun"] = lambda: source_light(spec, lambda *path: rng(0, *path))
    return taken(attempts)


def textured(value: float) -> CaseMeasured:
    """One texel of each map has the value."""
    def texture(name: str) -> Texture:
        maps: dict[str, Any] = {"base_color": np.full((4, 4, 3), 0.5, np.float32)}
        if name == "normal":
            maps[name] = np.tile(np.array([0, 0, 1], np.float32), (4, 4, 1))
        elif name not in maps:
            maps[name] = np.full((4, 4, 3) if name in COLOURED else (4, 4), 0.5, np.float32)
        maps[name][(2, 3, 0)[:maps[name].ndim]] = value
        return Texture(**maps)
    attempts: dict[str, Callable[[], object]] = {
        name: partial(pack, [Material(name="painted", base_color=(1, 1, 1), texture=texture(name))])
        for name in ("base_color", "roughness", "metallic", "normal", "alpha", *MORE_MAPS)}
    return taken(attempts, says="painted")

texture_nan = Case(
    name="refused/texture-nan", bound=0.0, figure=TAKEN, measure=lambda size: textured(np.nan),
    expectation="a NaN in any map of a texture is refused, with the material's name",
    failure="one black or white pixel, from where NaN spreads over the picture")

texture_inf = Case(
    name="refused/texture-inf", bound=0.0, figure=TAKEN, measure=lambda size: textured(np.inf),
    expectation="an infinite texel in any map is refused, with the material's name",
    failure="an object that shines without bound")

texture_negative = Case(
    name="refused/texture-negative", bound=0.0, figure=TAKEN, measure=lambda size: textured(-8.0),
    expectation="a texel of -8 in any map is refused, with the material's name",
    failure="negative light")

texture_huge = Case(
    name="refused/texture-1e8", bound=0.0, figure=TAKEN, measure=lambda size: textured(1e8),
    expectation="a texel of 1e8 in any map is refused, with the material's name",
    failure="a texel that half makes infinite, or a surface that reflects more than it receives")


@hard_case(name="refused/material", bound=0.0, figure=TAKEN,
           expectation="factors outside their range are refused, with the material's name",
           failure="a surface that reflects more than it receives, or NaN")
def material(size: Size) -> CaseMeasured:
    """NaN, albedo above 1, negative roughness, less than no refraction."""
    plain = Material(name="painted", base_color=(1, 1, 1))
    changes: dict[str, dict[str, Any]] = {
        "albedo of NaN": {"base_color": (np.nan, 0, 0)}, "albedo of 2": {"base_color": (0, 2, 0)},
        "roughness of -1": {"roughness": -1.0}, "metallic of Inf": {"metallic": np.inf}, "index of 0.5": {"ior": 0.5},
        "transmission of 2": {"transmission": 2.0}, "sheen of -1": {"sheen": (0, 0, -1)}}
    return taken({name: partial(pack, [replace(plain, **change)]) for name, change in changes.items()},
                 says="painted")


@hard_case(name="refused/beyond-half", bound=0.0, figure=TAKEN,
           expectation="a value beyond 65504 is not stored as half: gate and encoder both refuse it, and the gate a "
                       "layer of 1e-8, which would be 0",
           failure="Inf in a file, or a highlight that was clipped")
def beyond_half(size: Size) -> CaseMeasured:
    """The next float32 above, and a million; and what is too dim."""
    attempts: dict[str, Callable[[], object]] = {}
    silent = []
    for value in (65520.0, 1e6):
        layer = np.full((2, 2, 3), value, np.float32)
        attempts[f"{value:g}"] = partial(encode, layer, layer="i_t", key=KEY, dtype="float16")
        silent += [] if storable({"i_t": layer}, "float16") else [f"storable: expected to tell {value:g}"]
    found = taken(attempts, says="65504")
    dim = np.full((2, 2, 3), 1e-8, np.float32)
    silent += [] if storable({"i_t": dim}, "float16") else ["storable: expected to tell 1e-08, which becomes 0"]
    return CaseMeasured(figure=found.figure + len(silent), wrong=(*found.wrong, *silent))


@hard_case(name="refused/layer-nan", bound=0.0, figure=TAKEN,
           expectation="a layer with one NaN, Inf or negative value is not stored: identities and the encoder refuse "
                       "it",
           failure="invalid pixels in a shard")
def layer_nan(size: Size) -> CaseMeasured:
    """The last line of defence, whatever the renderer does."""
    attempts: dict[str, Callable[[], object]] = {}
    silent = []
    tolerances = {name: tolerance for name, _, tolerance in identity_table("float32")}
    for value in (np.nan, np.inf, -1.0):
        layer = np.ones((2, 2, 3), np.float32)
        layer[1, 0, 2] = value
        silent += [] if check_layers({"s": layer}, {"s": "frame"}, tolerances) else [f"identities: told not {value:g}"]
        if not np.isfinite(value):
            attempts[f"{value:g}"] = partial(encode, layer, layer="s", key=KEY, dtype="float32")
    found = taken(attempts)
    return CaseMeasured(figure=found.figure + len(silent), wrong=(*found.wrong, *silent))


@hard_case(name="refused/mesh", bound=0.0, figure=TAKEN,
           expectation="meshes of NaN, of flat faces only, and too fine for memory are refused",
           failure="a crash deep inside, or hours of swapping")
def mesh(size: Size) -> CaseMeasured:
    """And noise without a bound."""
    cube = box_mesh((0, 0, 0), (1, 1, 1))
    return taken({
        "NaN position": lambda: bare(np.array([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]]), [[0, 1, 2]]),
        "only flat faces": lambda: repair(bare(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]]), [[0, 1, 2]])),
        "billions of faces": lambda: split_long_edges(cube, 1e-5),
        "edges of length 0": lambda: split_long_edges(cube, 0.0),
        "noise of NaN": lambda: displace(cube, sigma=np.nan, radius=1.0, direction="isotropic", rng=rng(0)),
    }, says="")

seed = Case(
    name="refused/seed", bound=0.0, figure=TAKEN,
    measure=lambda size: taken({"2^64": lambda: derive_seed(2**64), "-1": lambda: derive_seed(-1)}, error=ValueError),
    expectation="seeds of more than 64 bits, and negative ones, are refused",
    failure="two seeds that give the same dataset")
