"""Runs inside Blender's Python: builds scenes and renders them with Cycles, as told line by line on standard input.

Each line is a JSON object and gets one in return: {"do": "load", "folder": ...}, {"do": "show", "name": ...},
{"do": "render", "spp": ..., "threshold": ..., "denoise": ..., "seed": ..., "window": ..., "passes": ..., "out": ...}.
"""

import json
import os
import sys
from pathlib import Path
from time import perf_counter

import bpy
from blender_scene import Loaded

PASSES = ("diffuse_direct", "diffuse_indirect", "diffuse_color", "glossy_color")


def settle(loaded: Loaded, threads: int) -> None:
    """Everything that does not change between renders: unbiased, uncoloured, box filter, scene data kept."""
    scene, cycles, found = loaded.scene, loaded.scene.cycles, loaded.found
    scene.render.engine, scene.render.use_sequencer = "CYCLES", False
    scene.render.resolution_x, scene.render.resolution_y = found["width"], found["height"]
    scene.render.resolution_percentage = 100
    scene.render.threads_mode, scene.render.threads = "FIXED", threads
    scene.render.use_persistent_data = True
    scene.view_settings.view_transform = "Raw"
    cycles.device, cycles.pixel_filter_type, cycles.filter_width = "CPU", "BOX", 1.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.blur_glossy, cycles.caustics_reflective, cycles.caustics_refractive = 0, True, True
    cycles.denoiser, cycles.denoising_input_passes = "OPENIMAGEDENOISE", "RGB_ALBEDO_NORMAL"
    cycles.use_auto_tile = False
    settings = scene.render.image_settings
    settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth, settings.exr_codec = "OPEN_EXR_MULTILAYER", "32", "ZIP"


def bound(loaded: Loaded, bounces: int) -> None:
    """Equal limits for every kind of bounce."""
    for name in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces"):
        setattr(loaded.scene.cycles, name, bounces)


def denoise_shading(loaded: Loaded) -> None:
    """Compositing that denoises the diffuse light: Cycles itself denoises the combined image only."""
    layer = loaded.scene.view_layers[0]
    layer.use_pass_diffuse_direct = layer.use_pass_diffuse_indirect = layer.cycles.denoising_store_passes = True
    tree = bpy.data.node_groups.new("denoise", "CompositorNodeTree")
    tree.interface.new_socket(name="Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    kinds = ("CompositorNodeRLayers", "ShaderNodeMix", "CompositorNodeDenoise", "NodeGroupOutput")
    passes, both, denoise, out = (tree.nodes.new(kind) for kind in kinds)
    both.data_type, both.blend_type, both.inputs[0].default_value = "RGBA", "ADD", 1
    colours = [socket for socket in both.inputs if socket.type == "RGBA"]
    tree.links.new(passes.outputs["Diffuse Direct"], colours[0])
    tree.links.new(passes.outputs["Diffuse Indirect"], colours[1])
    tree.links.new(next(socket for socket in both.outputs if socket.type == "RGBA"), denoise.inputs["Image"])
    tree.links.new(passes.outputs["Denoising Normal"], denoise.inputs["Normal"])
    tree.links.new(passes.outputs["Denoising Albedo"], denoise.inputs["Albedo"])
    tree.links.new(denoise.outputs["Image"], out.inputs[0])
    loaded.scene.compositing_node_group = tree


def render(loaded: Loaded, order: dict) -> dict:
    """Render once and write the passes; seconds of the call alone. window: left, top, right, bottom in pixels.

    denoise: "combined" is Cycles' own; "shading" goes through compositing; else none.
    """
    scene, cycles, layer = loaded.scene, loaded.scene.cycles, loaded.scene.view_layers[0]
    cycles.samples, cycles.seed = order["spp"], order["seed"]
    cycles.use_adaptive_sampling = order["threshold"] > 0
    if cycles.use_adaptive_sampling:
        cycles.adaptive_threshold = order["threshold"]
    cycles.use_denoising = order["denoise"] == "combined"
    scene.render.use_compositing = layer.cycles.denoising_store_passes = order["denoise"] == "shading"
    for name in PASSES:
        setattr(layer, f"use_pass_{name}", name in order["passes"])
    _border(scene.render, order["window"])
    start = perf_counter()
    bpy.ops.render.render()
    seconds = perf_counter() - start
    bpy.data.images["Render Result"].save_render(order["out"])
    return {"seconds": seconds}


def _border(settings: object, window: list | None) -> None:
    """Trace only what is within the window; the picture keeps its size."""
    settings.use_border = window is not None
    if window is not None:
        left, top, right, bottom = window
        settings.border_min_x, settings.border_max_x = left / settings.resolution_x, right / settings.resolution_x
        settings.border_min_y = 1 - bottom / settings.resolution_y
        settings.border_max_y = 1 - top / settings.resolution_y


def main() -> None:
    """Answer until standard input ends; what Blender prints goes to standard error."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    threads, loaded = int(sys.argv[1]), None
    answers.write(json.dumps({"version": bpy.app.version_string}) + "\n")
    for line in sys.stdin:
        order, answer = json.loads(line), {}
        if order["do"] == "load":
            loaded = Loaded(Path(order["folder"]))
            settle(loaded, threads)
            denoise_shading(loaded)
        elif order["do"] == "show":
            loaded.show(order["name"])
            bound(loaded, order["bounces"])
        else:
            answer = render(loaded, order)
        answers.write(json.dumps(answer) + "\n")


if __name__ == "__main__":
    main()
