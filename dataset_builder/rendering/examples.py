"""Passes -> examples: layers as images, evidence for the gates, and the figures of the record."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, process_time
from typing import get_args

import numpy as np

from dataset_builder.label.example_label import LayerAccuracy, PassRecord, RenderRecord
from dataset_builder.label.example_plan import ExamplePlan
from dataset_builder.label.roughness_record import RoughnessRecord, ShapeRoughness
from dataset_builder.label.scene_plan import Vector
from dataset_builder.layers import HALF, LAYERS, Pass
from dataset_builder.planning.effects.pass_extents import guide_extents, has_direct
from dataset_builder.rendering import plugins
from dataset_builder.rendering.denoise import Noisy, denoised
from dataset_builder.rendering.device import memory_told
from dataset_builder.rendering.field_pass import OPACITY
from dataset_builder.rendering.field_shelf import NO_SHELF, FieldShelf, tasks_of
from dataset_builder.rendering.light_probe import CHANNELS
from dataset_builder.rendering.pass_inputs import asked, needed_passes, needs_lighting
from dataset_builder.rendering.pass_memory import NO_MEMORY, PassMemory, PassResult
from dataset_builder.rendering.passes import (
    FIRST_HIT_CHANNELS,
    RADIANCE_LAYERS,
    WANTED,
    channels_of,
    deviation,
    first_hit_layers,
    radiance_channels,
)
from dataset_builder.rendering.rough_images import overlap, relmse
from dataset_builder.rendering.sampling.heavy_tails import LayerMean, layer_mean, least_known
from dataset_builder.rendering.sampling.moments import Estimate, quantile, relative, root_mean_square
from dataset_builder.rendering.view_passes import ViewPasses

ERROR_SUFFIX = "_se"
EVIDENCE = ("i_t", "s", "spec", "air")


@dataclass(frozen=True, kw_only=True, eq=False)
class Rendered:
    """One example in pixels."""

    plan: ExamplePlan
    layers: dict[str, np.ndarray]
    """Name -> (H, W, C) float32."""
    evidence: dict[str, np.ndarray]
    """Images of the same kind that gates need and that are not shipped."""
    record: RenderRecord
    """Figures for the label, the same bits on every repetition."""
    seconds: dict[str, float]
    """Wall time of every pass that this example was first to need and that ran."""
    cpu_seconds: dict[str, float]
    """The same in seconds of this process on all its cores, which other processes do not lengthen."""
    recalled: tuple[str, ...]
    """Passes that were remembered instead."""


def render_view(plans: Sequence[ExamplePlan], mesh_root: Path, memory: PassMemory = NO_MEMORY,
                fields: FieldShelf = NO_SHELF) -> Iterator[Rendered]:
    """Render examples of one view, in the order given; `backend.activate` must have run in this process. fields: where
    the fields are that the plans ask for.

    Raises ValueError for plans of different views: they could not share passes; OutputError where memory runs out.
    """
    if len(views := {plan.view for plan in plans}) != 1:
        raise ValueError(f"expected plans of one view, got {sorted(views)}")
    plugins.register()
    shared = ViewPasses(plan=plans[0], mesh_root=mesh_root, memory=memory, fields=fields)
    for plan in plans:
        shared.spent.clear()
        shared.worked.clear()
        shared.recalled.clear()
        with memory_told(plan.key):
            shared.run(plan)
        layers = _layers(shared, plan)
        evidence = _evidence(shared, plan)
        yield Rendered(plan=plan, layers=layers, evidence=evidence, record=_record(shared, plan, evidence),
                       seconds=dict(shared.spent), cpu_seconds=dict(shared.worked),
                       recalled=tuple(shared.recalled))


def _layers(shared: ViewPasses, plan: ExamplePlan) -> dict[str, np.ndarray]:
    """Every layer asked for, denoised where that is asked for."""
    layers = {name: layer_image(shared, plan, name, extent) for name, extent in plan.render.layers}
    if not plan.render.denoise:
        return layers
    start, worked = perf_counter(), process_time()
    guides = {name: layer_image(shared, plan, name, extent) for name, extent in guide_extents(plan.render).items()}
    direct = {"s_prime": _direct(shared, plan)} if has_direct(plan.render) else {}
    layers = denoised(layers, guides, direct, plan.render.denoise, dict(plan.render.layers))
    shared.spent["denoise"] = perf_counter() - start
    shared.worked["denoise"] = process_time() - worked
    return layers


def _direct(shared: ViewPasses, plan: ExamplePlan) -> Noisy:
    """S' without light that has bounced, wherever S' was traced, and its standard error."""
    result, channels = shared.rough_direct(plan), radiance_channels("s_prime")
    mean, error = (_image(plan, result.pixels, values[:, channels]) for values in (result.found.mean,
                                                                                   result.found.error))
    return mean, error


def layer_image(shared: ViewPasses, plan: ExamplePlan, name: str, extent: str) -> np.ndarray:
    """(H, W, C) float32 of one layer; 0 outside its extent."""
    if name == "mask_field" and not plan.field.there:
        name = "mask"
    if name == "instance":
        return _image(plan, shared.instances().pixels, shared.instances().found.mean)
    result = shared.result(LAYERS[name].render_pass, plan)
    values, inside = _values(result, name, shared.first_hit().facts["unit"]), _inside(shared, plan, name, extent)
    return _image(plan, result.pixels[inside], values[inside])


def _inside(shared: ViewPasses, plan: ExamplePlan, name: str, extent: str) -> np.ndarray:
    """(P,) which pixels of a layer's pass belong to its extent."""
    pixels = shared.result(LAYERS[name].render_pass, plan).pixels
    if extent == "frame" or _through_field(plan, name):
        return np.ones(len(pixels), dtype=bool)
    return np.isin(pixels, shared.covered() if LAYERS[name].geometry == "3dm" else shared.covered_by_either(plan))


def _through_field(plan: ExamplePlan, name: str) -> bool:
    """Whether a layer shows a field, which ends where its opacity does."""
    return plan.field.there and LAYERS[name].render_pass == "source"


def _values(result: PassResult, name: str, unit: float) -> np.ndarray:
    """(P, C) values of a layer on the pixels of its pass. unit: metres per unit of the frame it was rendered in."""
    layer = LAYERS[name]
    if name == "mask_field":
        return np.clip(result.found.mean[:, OPACITY], 0, 1)
    if not layer.radiometric:
        values = first_hit_layers(result.found)[name.removesuffix("_rough")]
        return values * unit if layer.unit == "m" else values
    channels = radiance_channels(layer.of or name)
    source = result.found.error if name.endswith(ERROR_SUFFIX) else \
        result.found.half if name == HALF else result.found.mean
    # The specular part is a difference of floats, which rounding may leave a hair below 0
    return np.maximum(source[:, channels], 0) if name == "spec" else source[:, channels]


def _image(plan: ExamplePlan, pixels: np.ndarray, values: np.ndarray) -> np.ndarray:
    image = np.zeros((plan.render.height * plan.render.width, values.shape[1]), dtype=np.float32)
    image[pixels] = values
    return image.reshape(plan.render.height, plan.render.width, -1)


def _evidence(shared: ViewPasses, plan: ExamplePlan) -> dict[str, np.ndarray]:
    """Layers that the gates need, on the object: masks of both meshes, and radiance, its parts and its errors."""
    names = {"mask", "d"}
    passes = needed_passes(plan)
    if "target" in passes:
        names |= {name + suffix for name in EVIDENCE for suffix in ("", ERROR_SUFFIX)}
    if "first_hit_rough" in passes:
        names.add("mask_rough")
    if plan.field.there and "source" in passes:
        names.add("mask_field")
    images = {name: layer_image(shared, plan, name, "object") for name in sorted(names)}
    return images | (_deviations(shared, plan) if "target" in passes else {})


def _deviations(shared: ViewPasses, plan: ExamplePlan) -> dict[str, np.ndarray]:
    """How much d and s vary within each pixel, on the object."""
    first, target = shared.first_hit(), shared.target(plan)
    return {"sd_d": _image(plan, first.pixels, deviation(first.found, FIRST_HIT_CHANNELS, "d")),
            "sd_s": _image(plan, target.pixels, deviation(target.found, channels_of(WANTED["target"]), "shading"))}


def _record(shared: ViewPasses, plan: ExamplePlan, evidence: dict[str, np.ndarray]) -> RenderRecord:
    """Figures of the passes behind an example and of its layers; a pass that was not needed has zeros."""
    ran = needed_passes(plan)
    nothing = Estimate.exact(np.zeros((1, CHANNELS)))
    light = shared.lighting(plan).found if needs_lighting(plan) else nothing
    rough = shared.first_hit_rough(plan).facts if "first_hit_rough" in ran else {}
    return RenderRecord(
        passes=tuple(_pass_record(shared, plan, name) if name in ran else PassRecord(name=name)
                     for name in get_args(Pass)),
        layers=tuple(_accuracy(shared, plan, name, extent) for name, extent in plan.render.layers
                     if name in RADIANCE_LAYERS),
        roughness_rms=rough.get("rms", 0.0), roughness_max=rough.get("maximum", 0.0),
        bounding_radius=rough.get("radius", 0.0),
        roughness=(_roughness(shared, plan, rough, evidence),) if "rms" in rough else (),
        field=tuple(shared.fields.get(task, shared.mesh_root).record for task in tasks_of(plan)),
        lighting_sh=_by_colour(light.mean), lighting_sh_se=_by_colour(light.error))


def _roughness(shared: ViewPasses, plan: ExamplePlan, measured: Mapping[str, float],
               evidence: dict[str, np.ndarray]) -> RoughnessRecord:
    """What was measured on the meshes, and the silhouettes and S' of the view."""
    images = dict(evidence)
    if asked(plan, "target") and asked(plan, "rough"):
        images |= {name: layer_image(shared, plan, name, "object") for name in ("s_prime", "s_prime" + ERROR_SUFFIX)}
    figures = {name: value for name, value in measured.items() if name in ShapeRoughness.model_fields}
    return RoughnessRecord(**figures, silhouette_iou=overlap(images["mask"], images["mask_rough"]),
                           s_relmse=relmse(images))


def _by_colour(channels: np.ndarray) -> tuple[Vector, ...]:
    """Coefficients of red, green and blue each, from (1, 3 N) of all in turn."""
    return tuple((red, green, blue) for red, green, blue in channels.reshape(-1, 3).tolist())


def _pass_record(shared: ViewPasses, plan: ExamplePlan, name: Pass) -> PassRecord:
    spp = shared.result(name, plan).found.spp
    if not len(spp):
        return PassRecord(name=name)
    return PassRecord(name=name, pixels=len(spp), spp=float(spp.mean()), spp_min=int(spp.min()),
                      spp_max=int(spp.max()), paths=int(spp.sum()))


def _accuracy(shared: ViewPasses, plan: ExamplePlan, name: str, extent: str) -> LayerAccuracy:
    """How good a layer became: relative errors over its extent and over the object, as `moments.relative` means them,
    and why sampling ended."""
    render_pass = LAYERS[name].render_pass
    result, channels = shared.result(render_pass, plan), radiance_channels(name)
    figures: dict[str, float] = {}
    means: list[LayerMean] = []
    # Paths that a part of an image has not met are those that the image has not met
    image = channels_of(WANTED[render_pass])["image"] if "image" in WANTED[render_pass] else channels
    joined = plan.effects.of(render_pass).transport == "joined"
    for prefix, kind in (("", extent), ("object_", "object")):
        inside = _inside(shared, plan, name, kind)
        errors = relative(result.found.mean[inside, channels], result.found.error[inside, channels])
        means.append(layer_mean(result.raw, channels, inside, together=joined, image=image))
        figures |= {f"{prefix}relative_error": root_mean_square(errors), f"{prefix}relative_error_95": quantile(errors),
                    f"{prefix}mean_error": means[-1].error}
    own = means[0]
    whole = layer_mean(result.raw, image, _inside(shared, plan, name, extent)) if own.error else own
    return LayerAccuracy(name=name, stopped=result.stopped.get(name, "spp"), **figures, tail=own.tail,
                         top_share=own.top_share, mean_known=least_known(own, whole))
