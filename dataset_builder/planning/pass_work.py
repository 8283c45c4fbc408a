"""What the passes of a view have to do: how often each runs, on which pixels, with how many samples, how fast."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import inf, lcm

from dataset_builder.label.example_plan import ExamplePlan, GoalPlan, RenderPlan
from dataset_builder.layers import LAYERS, PASSES, Extent

INSTANCE = "instance"
"""The instance layer has a pass of its own: one ray through the centre of every pixel."""
RUNS = (*PASSES, INSTANCE)


@dataclass(frozen=True, kw_only=True)
class Rates:
    """How fast a machine is and how well layers compress; `make bench` measures them."""

    light_paths: float = 7.8e5
    """Paths per second and core of passes with light, from the camera alone."""
    free_paths: float = 2.4e6
    """Paths per second and core of passes without light."""
    seconds_per_pass: float = 0.02
    """Building the scene and launching."""
    seconds_per_view: float = 0.4
    """Planning, meshes and textures."""
    seconds_per_example: float = 0.05
    """Writing and verifying."""
    kept_share: float = 0.92
    """Stored bytes over raw bytes where a layer holds values."""
    empty_share: float = 0.002
    """Stored bytes over raw bytes where a layer is 0."""
    example_bytes: float = 20_000.0
    """Of the record and the preview."""
    noise: float = 1.6
    """Relative error at one sample per pixel, typical of layers with light by camera paths; goals of accuracy are
    expected to take (noise / error)^2 samples."""
    image_paths: float = 9e6
    """Samples per second and core of images of an object alone, most of which miss it."""
    seconds_per_image: float = 0.05
    """Of such an image, to launch and keep it."""
    seconds_per_field: float = 5.0
    """Before and after the steps of a fit: pixels, hull, mesh, figures."""
    seconds_per_step: float = 0.025
    """Of a fit, whatever its grid."""
    seconds_per_cell: float = 1.8e-8
    """Of a step of a fit, per cell of its grid."""
    bytes_per_cell: float = 2.0
    """Of a field's file."""
    joined_time: float = 1.3
    """Times the seconds of a camera path that one joined with light paths takes, these included."""
    joined_noise: float = 0.6
    """Times the noise of camera paths that joined ones have at equal samples."""

    def of(self, plan: ExamplePlan, name: str) -> tuple[float, float]:
        """Paths per second and core of a pass, and its noise."""
        if name.startswith(("first_hit", INSTANCE)):
            return self.free_paths, self.noise
        if plan.effects.of(name).transport == "joined":
            return self.light_paths / self.joined_time, self.noise * self.joined_noise
        return self.light_paths, self.noise


def pass_of(layer: str) -> str:
    """The pass that a layer comes from."""
    return INSTANCE if layer == INSTANCE else LAYERS[layer].render_pass


def pass_runs(layers: Iterable[tuple[str, Extent]], lights: int, levels: int) -> dict[str, int]:
    """How often each pass runs for one view: what nobody asked for never, what examples share once.

    The object's pixels come from the light-free passes, so that the first always runs, and the rough one with any rough
    layer. The rough one shares the scene of each light and level, and runs in each.
    """
    asked = {pass_of(name) for name, _ in layers} | {"first_hit"}
    if asked & {"rough", "pbr"}:
        asked.add("first_hit_rough")
    times = _times(lights, levels)
    return {name: times[name] if name in asked else 0 for name in RUNS}


def pass_share(name: str, plan: ExamplePlan, window: float) -> float:
    """Share of the frame that a pass traces: all of it where it was planned on the frame, else the object's pixels.

    Light-free passes look for these pixels in the rectangle about the object, which takes the share `window`.
    """
    if name == INSTANCE or plan.effects.of(name).extent == "frame":
        return 1.0
    return window if name.startswith("first_hit") else plan.camera.coverage


def expected_spp(render: RenderPlan, name: str, noise: float, pace: float) -> float:
    """Samples per pixel of a pass: fixed, or what its layers' goals are likely to take. pace: those of a second."""
    first = 1 if name == INSTANCE else sum(render.parts(name))
    return max([first, *(_goal_spp(goal, noise, pace) for goal in render.goals if pass_of(goal.layer) == name)])


def _goal_spp(goal: GoalPlan, noise: float, pace: float) -> float:
    """Sampling ends with the error, the time or the cap, whichever comes first."""
    by_error = (noise / goal.error) ** 2 if goal.error else inf
    return min(by_error, goal.seconds * pace if goal.seconds else inf, goal.cap)


def files_per_example(layer: str, lights: int, levels: int, per_shard: int) -> float:
    """Files of a layer over examples, where a shard of `per_shard` examples has those of a run of its pass once.

    A pass that runs t times for the e examples of a view makes blocks of b = e / t neighbours with equal pixels. Shards
    begin at every multiple of n = `per_shard`; those that are no multiple of b cut a block in two, which costs a file.
    """
    block = lights * levels // _times(lights, levels)[pass_of(layer)]
    return 1 / block + 1 / per_shard - 1 / lcm(block, per_shard)


def _times(lights: int, levels: int) -> dict[str, int]:
    """Runs of every pass for one view, were all of them asked for."""
    each = lights * levels
    return {"source": 1, "source_clean": 1, "target": lights, "empty": lights, "rough": each, "pbr": each,
            "first_hit": 1, "first_hit_rough": each, INSTANCE: 1}
