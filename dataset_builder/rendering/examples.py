"""Passes -> examples: layers as images, evidence for the gates, and the figures of the record."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

from dataset_builder.layers import LAYERS, Pass
from dataset_builder.planning.example_plan import ExamplePlan
from dataset_builder.rendering import plugins
from dataset_builder.rendering.passes import FIRST_HIT_CHANNELS, RADIANCE_CHANNELS, deviation, first_hit_layers
from dataset_builder.rendering.view_passes import PassResult, ViewPasses, needed_passes

RADIANCE_LAYERS = {"i_s": "image", "i_t": "image", "s": "shading", "s_prime": "shading", "spec": "specular"}
"""Channels of a radiance pass that a layer takes."""

ERROR_SUFFIX = "_se"
EVIDENCE = ("i_t", "s", "spec")


@dataclass(frozen=True, kw_only=True, eq=False)
class Rendered:
    """One example in pixels.

    layers: name -> (H, W, C) float32. evidence: images of the same kind that gates need and that are not shipped.
    record: figures for the label, the same bits on every repetition. seconds: wall time of every pass this example was
    first to need.
    """

    plan: ExamplePlan
    layers: dict[str, np.ndarray]
    evidence: dict[str, np.ndarray]
    record: dict[str, Any]
    seconds: dict[str, float]


def render_view(plans: Sequence[ExamplePlan], mesh_root: Path) -> Iterator[Rendered]:
    """Render examples of one view, in the order given; `backend.activate` must have run in this process.

    Raises ValueError for plans of different views: they could not share passes.
    """
    if len(views := {plan.view for plan in plans}) != 1:
        raise ValueError(f"expected plans of one view, got {sorted(views)}")
    plugins.register()
    shared = ViewPasses(plan=plans[0], mesh_root=mesh_root)
    for plan in plans:
        shared.spent.clear()
        shared.run(plan)
        layers = {name: layer_image(shared, plan, name, extent) for name, extent in plan.render.layers}
        yield Rendered(plan=plan, layers=layers, evidence=_evidence(shared, plan), record=_record(shared, plan),
                       seconds=dict(shared.spent))


def layer_image(shared: ViewPasses, plan: ExamplePlan, name: str, extent: str) -> np.ndarray:
    """(H, W, C) float32 of one layer; 0 outside its extent."""
    if name == "instance":
        return _image(plan, shared.instances().pixels, shared.instances().found.mean)
    result = shared.result(LAYERS[name].render_pass, plan)
    values = _values(result, name)
    if extent == "object":
        keep = shared.covered() if LAYERS[name].geometry == "3dm" else shared.covered_by_either(plan)
        inside = np.isin(result.pixels, keep)
        return _image(plan, result.pixels[inside], values[inside])
    return _image(plan, result.pixels, values)


def _values(result: PassResult, name: str) -> np.ndarray:
    """(P, C) values of a layer on the pixels of its pass."""
    layer = LAYERS[name]
    if not layer.radiometric:
        return first_hit_layers(result.found)[name.removesuffix("_rough")]
    channels = RADIANCE_CHANNELS[RADIANCE_LAYERS[name.removesuffix(ERROR_SUFFIX)]]
    source = result.found.error if name.endswith(ERROR_SUFFIX) else result.found.mean
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
    images = {name: layer_image(shared, plan, name, "object") for name in sorted(names)}
    return images | (_deviations(shared, plan) if "target" in passes else {})


def _deviations(shared: ViewPasses, plan: ExamplePlan) -> dict[str, np.ndarray]:
    """How much d and s vary within each pixel, on the object."""
    first, target = shared.first_hit(), shared.target(plan)
    return {"sd_d": _image(plan, first.pixels, deviation(first.found, FIRST_HIT_CHANNELS, "d")),
            "sd_s": _image(plan, target.pixels, deviation(target.found, RADIANCE_CHANNELS, "shading"))}


def _record(shared: ViewPasses, plan: ExamplePlan) -> dict[str, Any]:
    """Figures of the passes behind an example. Keys never vary; a pass that was not needed has zeros.

    relative_error: root mean square of the standard error over the object's pixels, over the mean of the layer there.
    paths: camera paths of the pass, shared or not.
    """
    ran = needed_passes(plan)
    record: dict[str, Any] = {"passes": [_pass_record(shared, plan, name) if name in ran else _no_pass(name)
                                         for name in get_args(Pass)]}
    roughness = shared.twin(plan.rough).roughness if "first_hit_rough" in ran else None
    record["roughness_rms"] = roughness.rms if roughness else 0.0
    record["roughness_max"] = roughness.maximum if roughness else 0.0
    record["bounding_radius"] = roughness.radius if roughness else 0.0
    return record


def _no_pass(name: str) -> dict[str, Any]:
    return {"name": name, "pixels": 0, "spp": 0, "paths": 0, "relative_error": 0.0}


def _pass_record(shared: ViewPasses, plan: ExamplePlan, name: Pass) -> dict[str, Any]:
    result = shared.result(name, plan)
    pixels, spp = len(result.pixels), result.found.spp
    error = 0.0
    if name in ("source", "target", "rough"):
        channels = RADIANCE_CHANNELS["shading" if name == "rough" else "image"]
        inside = np.isin(result.pixels, shared.covered())
        mean, deviations = result.found.mean[inside, channels], result.found.error[inside, channels]
        error = float(np.sqrt(np.mean(deviations**2)) / max(mean.mean(), 1e-12)) if inside.any() else 0.0
    return {"name": name, "pixels": pixels, "spp": spp, "paths": pixels * spp, "relative_error": error}
