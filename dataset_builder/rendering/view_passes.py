"""The passes of one view, shared: light-free layers once, source light once, target light once per light, S' once per
level.

A pass runs when it is first asked for, on the pixels that its layers are wanted on, and is kept for the other examples
of the view.
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from time import perf_counter

import numpy as np

from dataset_builder.layers import LAYERS, Pass
from dataset_builder.planning.example_plan import ExamplePlan, GoalPlan, IlluminationPlan, RenderPlan, RoughPlan
from dataset_builder.rendering import passes
from dataset_builder.rendering.fog import Fog
from dataset_builder.rendering.frame import Frame
from dataset_builder.rendering.moments import Estimate
from dataset_builder.rendering.passes import FIRST_HIT_CHANNELS, RADIANCE_CHANNELS, RADIANCE_LAYERS, View
from dataset_builder.rendering.rounds import Goal, Refined, Stop, refine
from dataset_builder.rendering.rough_mesh import RoughTwin, rough_twin
from dataset_builder.rendering.scene import Body, Stage, body_of, staged
from dataset_builder.rendering.soup import Soup, clean, merge, surroundings
from dataset_builder.rendering.surface import Textures
from dataset_builder.rendering.window import covered_window
from dataset_builder.seeding import derive_seed

ORDER: tuple[Pass, ...] = ("first_hit", "target", "source", "first_hit_rough", "rough")


@dataclass(frozen=True, kw_only=True, eq=False)
class PassResult:
    """What one pass found. pixels: (P,) indices row * width + column, in rising order; seconds: scene building
    included."""

    pixels: np.ndarray
    found: Estimate
    seconds: float
    stopped: Mapping[str, Stop] = field(default_factory=dict)
    """Why sampling of each layer with a goal ended."""


@dataclass(kw_only=True)
class ViewPasses:
    """Geometry, scenes and passes of the view that `plan` belongs to. spent: seconds of passes run since it was
    cleared.

    The light-free passes of the 3DM have a scene without lamps, so that they are the same bits whatever light comes
    first; those of the R3DM share the scene of their light, the last that is open until `close`.
    """

    plan: ExamplePlan
    mesh_root: Path
    spent: dict[str, float] = field(default_factory=dict)
    _results: dict[tuple[str, ...], PassResult] = field(default_factory=dict)
    _twins: dict[RoughPlan, RoughTwin] = field(default_factory=dict)
    _rough_bodies: dict[RoughPlan, Body] = field(default_factory=dict)
    """Of the last noise level only: they are large."""
    _scene: ExitStack = field(default_factory=ExitStack)
    _open: tuple[object, Stage] | None = None

    def run(self, plan: ExamplePlan) -> None:
        """Every pass that a layer of the example needs, in the order that opens the fewest scenes; none stays open."""
        try:
            self.first_hit()
            if any(name == "instance" for name, _ in plan.render.layers):
                self.instances()
            for render_pass in needed_passes(plan):
                self.result(render_pass, plan)
        finally:
            self.close()

    def close(self) -> None:
        """Let the open scene go; results stay."""
        self._open = None
        self._scene.close()

    # Geometry

    @cached_property
    def frame(self) -> Frame:
        """Where the renderer's origin is, and how long its unit."""
        return Frame.of(clean(self.plan.target, self.mesh_root).corners)

    @cached_property
    def view(self) -> View:
        """Camera and resolution, in the frame."""
        return View(camera=self.frame.camera(self.plan.camera), render=self.plan.render)

    @cached_property
    def _target(self) -> Soup:
        return self.frame.soup(clean(self.plan.target, self.mesh_root))

    @cached_property
    def _room(self) -> Soup:
        return self.frame.soup(surroundings(self.plan, self.mesh_root))

    @cached_property
    def _materials(self) -> Textures:
        """Materials of the target and of everything about it: the same for every geometry of the view."""
        return Textures.upload([*self._target.materials, *self._room.materials], self._render.texture_size)

    @cached_property
    def _clean_body(self) -> Body:
        return self._body(self._target, self._room)

    def _body(self, target: Soup, room: Soup) -> Body:
        return body_of(merge([target, room]), self._materials, frozenset(self.plan.effects.features))

    @cached_property
    def _open_body(self) -> Body:
        """The clean scene without the parts that block the source light."""
        if not self.plan.source_light.open:
            return self._clean_body
        return self._body(self._target, self._room.without(self.plan.source_light.open))

    def _rough_body(self, rough: RoughPlan) -> Body:
        if rough not in self._rough_bodies:
            self._rough_bodies = {rough: self._body(self._rough_soup(rough), self._room)}
        return self._rough_bodies[rough]

    def _rough_soup(self, rough: RoughPlan) -> Soup:
        return self.frame.soup(self.twin(rough).soup)

    def twin(self, rough: RoughPlan) -> RoughTwin:
        """The R3DM of one noise level."""
        if rough not in self._twins:
            self._twins[rough] = rough_twin(self.plan.target, rough, self.mesh_root)
        return self._twins[rough]

    # Scenes

    def _dark_scene(self) -> Stage:
        return self._stage("dark", lambda: self._clean_body, None)

    def _rough_scene(self, plan: ExamplePlan) -> Stage:
        light = self._light(plan, "rough") if _asked(plan, "rough") else None
        return self._stage(("rough", plan.rough, plan.light), lambda: self._rough_body(plan.rough), light)

    def _light(self, plan: ExamplePlan, render_pass: Pass) -> IlluminationPlan:
        """The lights that a pass simulates, in the frame."""
        light = plan.source_light if render_pass == "source" else plan.target_light
        kept = tuple(light.lights[index] for index in plan.effects.of(render_pass).lights)
        return self.frame.illumination(light.model_copy(update={"lights": kept}))

    @cached_property
    def _fog(self) -> Fog | None:
        """The medium that fills the box of the room."""
        if "fog" not in self.plan.effects.features:
            return None
        room, fog = self.plan.room, self.frame.fog(self.plan.fog)
        half = np.array([room.width / 2, room.depth / 2, 0])
        low, high = self.frame.points(-half), self.frame.points(half + [0, 0, room.height])
        return Fog(fog.extinction, fog.albedo, fog.anisotropy, low.tolist(), high.tolist())

    def _stage(self, key: object, body: Callable[[], Body], light: IlluminationPlan | None) -> Stage:
        if self._open is None or self._open[0] != key:
            self.close()
            self._open = key, self._scene.enter_context(staged(body(), light, self._fog, self.mesh_root))
        return self._open[1]

    # Passes

    def result(self, render_pass: Pass, plan: ExamplePlan) -> PassResult:
        """What a pass found that an example of this view needs."""
        return {"first_hit": lambda _: self.first_hit(), "source": lambda _: self.source(), "target": self.target,
                "rough": self.rough, "first_hit_rough": self.first_hit_rough}[render_pass](plan)

    def first_hit(self) -> PassResult:
        """Light-free layers of the 3DM."""
        def make(pixels: np.ndarray) -> Estimate:
            return passes.first_hit(self.view, self._dark_scene(), pixels, spp=self._render.spp_first_hit,
                                    seed=self._seed("first_hit"))
        return self._once(("first_hit",), lambda: self._wanted("first_hit", self._window(self._target)), make)

    def first_hit_rough(self, plan: ExamplePlan) -> PassResult:
        """Light-free layers of the R3DM, once per light: its lamps stand in the scene, and the bits shall be the
        plan's."""
        def make(pixels: np.ndarray) -> Estimate:
            return passes.first_hit(self.view, self._rough_scene(plan), pixels, spp=self._render.spp_first_hit,
                                    seed=self._seed("first_hit_rough", plan.rough.level))
        return self._once(("first_hit_rough", str(plan.light), plan.rough.model_dump_json()),
                          lambda: self._wanted("first_hit_rough", self._window(self._rough_soup(plan.rough))), make)

    def instances(self) -> PassResult:
        """Instance at every pixel's centre."""
        def make(pixels: np.ndarray) -> Estimate:
            found = passes.instances(self.view, self._dark_scene(), pixels)
            return Estimate.exact(found[:, None])
        return self._once(("instance",), lambda: np.arange(self._render.width * self._render.height), make)

    def source(self) -> PassResult:
        """The 3DM under the source illumination, with what blocks it out of the way."""
        def stage() -> Stage:
            return self._stage("source", lambda: self._open_body, self._light(self.plan, "source"))
        return self._lit(("source",), self.plan, stage, self.covered, self._render.spp_source, self._seed("source"))

    def target(self, plan: ExamplePlan) -> PassResult:
        """The 3DM under one target illumination."""
        def stage() -> Stage:
            return self._stage(("target", plan.light), lambda: self._clean_body, self._light(plan, "target"))
        return self._lit(("target", str(plan.light)), plan, stage, self.covered, self._render.spp_target,
                         self._seed("target", plan.light))

    def rough(self, plan: ExamplePlan) -> PassResult:
        """The R3DM of one noise level under one target illumination."""
        return self._lit(("rough", str(plan.light), plan.rough.model_dump_json()), plan,
                         lambda: self._rough_scene(plan), lambda: self.covered_by_either(plan), self._render.spp_rough,
                         self._seed("rough", plan.light, plan.rough.level))

    def _lit(self, key: tuple[str, ...], plan: ExamplePlan, stage: Callable[[], Stage],
             covered: Callable[[], np.ndarray], first: int, seed: int) -> PassResult:
        """A pass with light, in as many rounds as its layers' goals ask for."""
        name = key[0]

        def make(pixels: np.ndarray) -> Refined:
            sample = passes.radiance_sampler(self.view, stage(), plan.effects.of(name).max_depth)
            goals = [self._goal(goal, pixels, covered()) for goal in plan.render.goals
                     if LAYERS[goal.layer].render_pass == name]
            return refine(sample, pixels, self._render.width, first=first, batches=self._render.batches, goals=goals,
                          seed=seed)
        return self._once(key, lambda: self._wanted(name, covered()), make)

    def _goal(self, goal: GoalPlan, pixels: np.ndarray, covered: np.ndarray) -> Goal:
        """A layer's goal on the pixels of its own extent."""
        extent = dict(self._render.layers).get(goal.layer, "object")
        inside = np.isin(pixels, covered) if extent == "object" else np.ones(len(pixels), dtype=bool)
        return Goal(layer=goal.layer, channels=RADIANCE_CHANNELS[RADIANCE_LAYERS[goal.layer]], inside=inside,
                    error=goal.error, seconds=goal.seconds, cap=goal.cap)

    # Pixels

    def covered(self) -> np.ndarray:
        """Pixels of which the 3DM covers some."""
        return _with_mask(self.first_hit())

    def covered_by_either(self, plan: ExamplePlan) -> np.ndarray:
        """Pixels of which the 3DM or the R3DM covers some."""
        return np.union1d(self.covered(), _with_mask(self.first_hit_rough(plan)))

    def _window(self, soup: Soup) -> np.ndarray:
        points = soup.corners[soup.instance == self.plan.target.instance].reshape(-1, 3)
        return covered_window(self.view.camera, points, self._render.width, self._render.height)

    def _wanted(self, render_pass: str, pixels: np.ndarray) -> np.ndarray:
        """The frame if the pass is planned there, else `pixels`."""
        everywhere = self.plan.effects.of(render_pass).extent == "frame"
        return np.arange(self._render.width * self._render.height) if everywhere else pixels

    # Bookkeeping

    @property
    def _render(self) -> RenderPlan:
        return self.plan.render

    def _seed(self, *path: str | int) -> int:
        return derive_seed(int(self._render.seed), *path)

    def _once(self, key: tuple[str, ...], where: Callable[[], np.ndarray],
              make: Callable[[np.ndarray], Estimate | Refined]) -> PassResult:
        if key not in self._results:
            pixels = where()
            start = perf_counter()
            made = make(pixels) if len(pixels) else Estimate.empty()
            refined = made if isinstance(made, Refined) else Refined(found=made, stopped={}, rounds=1)
            self._results[key] = PassResult(pixels=pixels, found=refined.found, seconds=perf_counter() - start,
                                            stopped=refined.stopped)
            self.spent[key[0]] = self.spent.get(key[0], 0.0) + self._results[key].seconds
        return self._results[key]


def needed_passes(plan: ExamplePlan) -> tuple[Pass, ...]:
    """The passes that the layers of an example need, in order; the first always, for it finds the object's pixels."""
    return tuple(name for name in ORDER if name == "first_hit" or _asked(plan, name)
                 or (name == "first_hit_rough" and _asked(plan, "rough")))


def _asked(plan: ExamplePlan, render_pass: Pass) -> bool:
    return any(LAYERS[name].render_pass == render_pass for name, _ in plan.render.layers)


def _with_mask(result: PassResult) -> np.ndarray:
    return result.pixels[result.found.mean[:, FIRST_HIT_CHANNELS["mask"]][:, 0] > 0]
