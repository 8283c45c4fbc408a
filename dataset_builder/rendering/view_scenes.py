"""What the passes of one view trace: geometry in the frame of the target object, and one open scene at a time."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from dataset_builder.assets.field_file import FieldFile
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.example_plan import ExamplePlan, RoughPlan
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import IlluminationPlan, PortalPlan
from dataset_builder.layers import Pass
from dataset_builder.planning.scene.box_shell import BoxShell
from dataset_builder.rendering.field_shelf import NO_SHELF, FieldShelf, FieldTask
from dataset_builder.rendering.pass_inputs import sky_radiance
from dataset_builder.rendering.passes import ViewSensor
from dataset_builder.rendering.scene.local_frame import LocalFrame
from dataset_builder.rendering.scene.open_scene import Body, OpenScene, body_of, open_scene
from dataset_builder.rendering.scene.seen_texels import seen_sides
from dataset_builder.rendering.scene.triangle_soup import (
    RoughTwin,
    Soup,
    clean,
    field_twin,
    merge,
    rough_twin,
    surroundings,
)
from dataset_builder.rendering.surface.material_table import Textures
from dataset_builder.rendering.transport.fog import Fog


@dataclass(kw_only=True)
class ViewScenes:
    """Geometry and scenes of the view that `plan` belongs to, made when first asked for.

    The light-free passes of the 3DM have a scene without lamps, so that they are the same bits whatever light comes
    first; those of the R3DM share the scene of their light. The last scene stays open until `close`.
    """

    plan: ExamplePlan
    mesh_root: Path
    fields: FieldShelf = NO_SHELF
    _twins: dict[RoughPlan, RoughTwin] = field(default_factory=dict)
    _rough_bodies: dict[RoughPlan, Body] = field(default_factory=dict)
    """Of the last noise level only: they are large."""
    _scene: ExitStack = field(default_factory=ExitStack)
    _open: tuple[object, OpenScene] | None = None

    def close(self) -> None:
        """Let the open scene go."""
        self._open = None
        self._scene.close()

    @cached_property
    def local_frame(self) -> LocalFrame:
        """Where the renderer's origin is, and how long its unit."""
        return LocalFrame.of(clean(self.plan.target, self.mesh_root).corners)

    @cached_property
    def view(self) -> ViewSensor:
        """Camera and resolution, in the frame."""
        return ViewSensor(camera=self.local_frame.camera(self.plan.camera), render=self.plan.render)

    @cached_property
    def clean_object(self) -> Soup:
        """The 3DM of the target object."""
        return self.local_frame.soup(clean(self.plan.target, self.mesh_root))

    @cached_property
    def _room(self) -> Soup:
        soup = self.local_frame.soup(surroundings(self.plan, self.mesh_root))
        return replace(soup, corners=soup.corners.astype(np.float32))

    @cached_property
    def _materials(self) -> Textures:
        """Materials of the target and of everything about it: the same for every geometry of the 3DM."""
        return self._uploaded(self.clean_object)

    def _uploaded(self, target: Soup) -> Textures:
        render, materials = self.plan.render, [*target.materials, *self._room.materials]
        if not render.texels_per_pixel:
            return Textures.upload(materials, render.texture_size, sky_radiance(self.plan))
        camera = Pinhole.of(self.view.camera, render.width, render.height)
        sides = [side for soup in (target, self._room)
                 for side in seen_sides(soup, camera, render.texels_per_pixel, render.texture_size)]
        return Textures.upload(materials, sides, sky_radiance(self.plan))

    @cached_property
    def _clean_body(self) -> Body:
        return self._body(self.clean_object, self._room)

    def _body(self, target: Soup, room: Soup) -> Body:
        narrow = replace(target, corners=target.corners.astype(np.float32))
        own = target.materials == self.clean_object.materials
        return body_of(merge([narrow, room]), self._materials if own else self._uploaded(target),
                       frozenset(self.plan.effects.features))

    @cached_property
    def _open_body(self) -> Body:
        """The clean scene without the parts that block the source light."""
        if not self.plan.source_light.open:
            return self._clean_body
        return self._body(self.clean_object, self._room.without(self.plan.source_light.open))

    @cached_property
    def _empty_body(self) -> Body:
        """The clean scene without the target object, whose materials keep their places."""
        hidden = self.clean_object.only(np.zeros(len(self.clean_object.corners), dtype=bool))
        # Light paths are aimed as they are where the object stands: that is no matter of right or wrong, but of noise
        return replace(self._body(hidden, self._room), casters=self._clean_body.casters)

    def _rough_body(self, rough: RoughPlan) -> Body:
        if rough not in self._rough_bodies:
            self._rough_bodies = {rough: self._body(self.rough_object(rough), self._room)}
        return self._rough_bodies[rough]

    def rough_object(self, rough: RoughPlan) -> Soup:
        """The R3DM of one noise level."""
        return self.local_frame.soup(self.twin(rough).soup)

    def twin(self, rough: RoughPlan) -> RoughTwin:
        """The R3DM of one noise level in the world, and how rough it is."""
        if rough not in self._twins:
            self._twins[rough] = self._twin(rough)
        return self._twins[rough]

    def _twin(self, rough: RoughPlan) -> RoughTwin:
        if not rough.field.there:
            return rough_twin(self.plan.target, rough, self.mesh_root)
        mesh = None if rough.field.kind == "own" else self.field(rough.field).mesh
        return field_twin(self.plan.target, rough, self.mesh_root, mesh)

    def field(self, plan: FieldPlan) -> FieldFile:
        """A field of the target object. Raises UserError where it was not made."""
        return self.fields.get(FieldTask(object=self.plan.target.object, field=plan), self.mesh_root)

    def window(self, soup: Soup) -> np.ndarray:
        """Pixels that the target object, of which `soup` holds the triangles, may cover; see `covered_window`."""
        points = soup.corners[soup.instance == self.plan.target.instance].reshape(-1, 3)
        return covered_window(Pinhole.of(self.view.camera, self.plan.render.width, self.plan.render.height), points)

    def dark(self) -> OpenScene:
        """The 3DM without light."""
        return self._opened("dark", lambda: self._clean_body)

    def source(self) -> OpenScene:
        """The 3DM under the source illumination, with what blocks it out of the way."""
        return self._opened("source", lambda: self._open_body, *self._light(self.plan, "source_clean"))

    def target(self, plan: ExamplePlan) -> OpenScene:
        """The 3DM under the target illumination of a plan."""
        return self._opened(("target", plan.light), lambda: self._clean_body, *self._light(plan, "target"))

    def surroundings(self, plan: ExamplePlan) -> OpenScene:
        """What is about the target object, which is hidden, under the target illumination of a plan."""
        return self._opened(("surroundings", plan.light), lambda: self._empty_body, *self._light(plan, "target"))

    def rough(self, plan: ExamplePlan, lit: bool = True) -> OpenScene:
        """The R3DM of a plan under its target illumination, or without light where nothing needs it."""
        light = self._light(plan, "rough") if lit else ()
        return self._opened(("rough", plan.rough, plan.light), lambda: self._rough_body(plan.rough), *light)

    def _light(self, plan: ExamplePlan, render_pass: Pass) -> tuple[IlluminationPlan, tuple[PortalPlan, ...]]:
        """The lights that a pass simulates and the openings that they get in through, in the frame."""
        light = plan.source_light if render_pass.startswith("source") else plan.target_light
        effects = plan.effects.of(render_pass)
        kept = tuple(light.lights[index] for index in effects.lights)
        return (self.local_frame.illumination(light.model_copy(update={"lights": kept})),
                tuple(map(self.local_frame.portal, effects.portals)))

    @cached_property
    def _fog(self) -> Fog | None:
        """The medium that fills the box of the room, or that of all that a scene from a file holds and the camera."""
        if "fog" not in self.plan.effects.features:
            return None
        fog = self.local_frame.fog(self.plan.fog)
        if self.plan.room.kind == "procedural":
            low, high = map(self.local_frame.points, BoxShell(self.plan.room).extent)
        else:
            low, high = bounds([self.clean_object.corners, self._room.corners, np.array(self.view.camera.position)])
        return Fog(fog.extinction, fog.albedo, fog.anisotropy, low.tolist(), high.tolist())

    def _opened(self, key: object, body: Callable[[], Body], light: IlluminationPlan | None = None,
                portals: Sequence[PortalPlan] = ()) -> OpenScene:
        if self._open is None or self._open[0] != key:
            self.close()
            self._open = key, self._scene.enter_context(
                open_scene(body(), light, self._fog, self.mesh_root, portals))
        return self._open[1]


def bounds(points: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """(3,) low and (3,) high corner of all points (..., 3)."""
    own = [each.reshape(-1, 3) for each in points if each.size]
    return np.min([each.min(axis=0) for each in own], axis=0), np.max([each.max(axis=0) for each in own], axis=0)


def covered_window(camera: Pinhole, points: np.ndarray) -> np.ndarray:
    """Indices row * width + column of the smallest rectangle of pixels that holds the projection of all points (N, 3).

    The whole frame where a point lies behind the camera; empty where the object is out of the frame.
    """
    column, row, distance = camera.project(points).T
    if distance.min() <= 0:
        return np.arange(camera.width * camera.height)
    left, right = np.clip([np.floor(column.min()) - 1, np.floor(column.max()) + 2], 0, camera.width).astype(int)
    top, bottom = np.clip([np.floor(row.min()) - 1, np.floor(row.max()) + 2], 0, camera.height).astype(int)
    return (np.arange(top, bottom)[:, None] * camera.width + np.arange(left, right)).ravel()
