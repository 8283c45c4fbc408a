"""Spec to ExamplePlan: every number drawn, each from a path of its own, so that one example can be planned alone."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial

from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.example_plan import ExamplePlan, GoalPlan, RenderPlan, SppPart
from dataset_builder.label.field_plan import FieldPlan
from dataset_builder.label.scene_plan import IlluminationPlan, ObjectPlan
from dataset_builder.layers import LAYERS, Extent
from dataset_builder.planning.catalogue import ExampleRef, PairRef, ViewRef, examples, sequence_of, views_of
from dataset_builder.planning.effects.decisions import plan_effects
from dataset_builder.planning.field_recipe import field_notes, field_plan, in_world
from dataset_builder.planning.rough_plan import rough_notes, rough_of_field, rough_plan
from dataset_builder.planning.scene.arrangement import Arrangement, arrange
from dataset_builder.planning.scene.assets_of_plan import asset_of
from dataset_builder.planning.scene.contents import ScenePlan, SplitContents, contents, place_of
from dataset_builder.planning.scene.object_size import size_problem
from dataset_builder.planning.scene.recent import Recent
from dataset_builder.planning.scene.scene_models import scene_facts
from dataset_builder.planning.scene.things import target_plan
from dataset_builder.planning.view.cameras import PlannedCamera, place_camera
from dataset_builder.planning.view.lights import source_light, target_light, unit_irradiance
from dataset_builder.planning.view.lit_view import lit_view
from dataset_builder.planning.view.paths import plan_path
from dataset_builder.planning.view.scene_cameras import own_camera
from dataset_builder.planning.view.scene_lights import check_lights_differ, scene_light
from dataset_builder.planning.view.view_path import ViewPath, path_camera
from dataset_builder.seeding import derive_seed, rng
from dataset_builder.spec.dataset import DatasetSpec
from dataset_builder.spec.field import FieldSpec
from dataset_builder.spec.render import SppSpec
from dataset_builder.spec.resolve import LoadedSpec

SCHEMA_VERSION = "1.0.0"
"""Of the ExamplePlan that is written beside the pixels."""
TEXELS_PER_PIXEL = 2.0
"""Of textures of scenes from files, which have hundreds; no picture shows more."""
KEPT_BYTES, TRIANGLE_BYTES = 1 << 30, 200
"""Of arrangements, and of a triangle in one: our arrays and the tree that rays go down."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewPlan:
    """What the examples of one view share: what stands where, the camera with what it sees, the source light."""

    arrangement: Arrangement
    view: PlannedCamera
    source: IlluminationPlan
    field: FieldPlan
    """What `i_s` shows in place of the 3DM."""


class Planner:
    """Plans the examples of one spec. It keeps what neighbours share; no plan depends on what it keeps."""

    def __init__(self, loaded: LoadedSpec):
        self.loaded = loaded
        self._arrangements = Recent[Arrangement](4, KEPT_BYTES, _bytes_of)
        self._views = Recent[ViewPlan](4, KEPT_BYTES, lambda view: _bytes_of(view.arrangement))
        self._paths = Recent[ViewPath](4)
        self._lights = Recent[tuple[IlluminationPlan, str]](64)

    @cached_property
    def examples(self) -> tuple[ExampleRef, ...]:
        """Every example of the dataset, in order of index."""
        return examples(self.loaded.dataset)

    @cached_property
    def contents(self) -> dict[str, SplitContents]:
        """Objects and scenes of every split. Raises PlanError where splits share one."""
        return contents(self.loaded)

    def arrangement(self, pair: PairRef) -> Arrangement:
        """What stands where in a pair's room. Raises PlanError where the target does not fit its room."""
        return self._arrangements.get(pair, lambda: self._arrangement(pair))

    def _arrangement(self, pair: PairRef) -> Arrangement:
        split = self.contents[pair.split]
        with self._odd_size_named(target_plan(self.loaded, split, pair)):
            return arrange(pair, self.loaded, split)

    @contextmanager
    def _odd_size_named(self, target: ObjectPlan) -> Iterator[None]:
        """Where planning fails for an object of unusual size, say so before all else: it may be why."""
        try:
            yield
        except PlanError as error:
            problems = [replace(problem, where=problem.where or place_of(self.loaded, target))
                        for problem in error.problems]
            found = size_problem(target, self.loaded)
            raise PlanError([*([found[0]] if found else ()), *problems]) from error

    def view(self, ref: ViewRef) -> ViewPlan:
        """Stage, camera and source light of a view. Raises PlanError where no camera sees the target."""
        return self._views.get(ref, lambda: self._view(ref))

    def _scene(self, pair: PairRef) -> ScenePlan:
        return self.contents[pair.split].scenes[pair.scene]

    def _view(self, ref: ViewRef) -> ViewPlan:
        spec, arrangement = self.loaded.dataset, self.arrangement(ref.pair)
        with self._odd_size_named(arrangement.target.object):
            arrangement, view = self._camera(ref, arrangement)
        seen, root = spec.split_of(ref.pair.split).source, self.loaded.path.parent
        field = field_plan(spec, seen if seen.image else None, ref.pair, arrangement.target.object, root)
        source = (in_world(field.light, arrangement.target.yaw, spec.source.open) if field.light.lights else
                  source_light(spec.source, partial(rng, spec.seed, *self._lit(ref).path, "source"), root, arrangement))
        return ViewPlan(arrangement=arrangement, view=view, source=source, field=field)

    def _camera(self, ref: ViewRef, placed: Arrangement) -> tuple[Arrangement, PlannedCamera]:
        """What stands where in a view, and its camera. placed: what the views of its pair share."""
        spec, scene, where = self.loaded.dataset, self._scene(ref.pair), _where(ref, placed)
        camera = spec.camera_of(ref.pair.split)
        if scene.file is not None and scene.file.cameras == "own":
            found = scene_facts(scene.room, self.loaded.path.parent).cameras
            return placed, own_camera(placed, found, camera, spec.image, ref.camera, where)
        if camera.path is None:
            return placed, place_camera(placed, camera, spec.image, rng(spec.seed, *ref.path, "camera"), where)
        path = self._paths.get(ref.pair, lambda: plan_path(self.loaded, ref.pair, placed, where))
        arrangement = placed.turned(path.frames[ref.camera].turn, self.loaded.path.parent)
        return arrangement, path_camera(arrangement, path, camera, ref.camera, where)

    def _lit(self, ref: ViewRef) -> ViewRef | PairRef:
        """What has the lights of a view: itself, or its pair."""
        return ref.pair if self.loaded.dataset.split_of(ref.pair.split).lights_per == "pair" else ref

    def _lit_views(self, ref: ViewRef) -> list[ViewPlan]:
        """The views that the lights of a view are for: itself, or all of its pair that can be had; of a target that
        turns, the first of these."""
        if self._lit(ref) == ref:
            return [self.view(ref)]
        spec, found = self.loaded.dataset, list[ViewPlan]()
        for other in views_of(spec, spec.split_of(ref.pair.split)):
            with suppress(PlanError):
                found += [self.view(other)] if other.pair == ref.pair else []
            if found and found[0].arrangement.sweep is not None:
                break
        return found

    def light(self, ref: ViewRef, number: int) -> tuple[IlluminationPlan, str]:
        """Target light `number` of a view and its note. Raises PlanError where none lights the target as asked."""
        return self._lights.get((self._lit(ref), number), lambda: self._light(ref, number))

    def _light(self, ref: ViewRef, number: int) -> tuple[IlluminationPlan, str]:
        spec, plan, views = self.loaded.dataset, self.view(ref), self._lit_views(ref)
        lit = lit_view(views[0].arrangement, [each.view for each in views], unit_irradiance(plan.source))
        # A lamp that shines alone is drawn as it is among all of them
        alone = dict(enumerate(spec.target.alone_of(spec.split_of(ref.pair.split).lights))).get(number)
        stream = partial(rng, spec.seed, *self._lit(ref).path, "light", number if alone is None else 0)
        scene, root = self._scene(ref.pair), self.loaded.path.parent
        where = f"{_where(ref, plan.arrangement)}, light {number}"
        with self._odd_size_named(plan.arrangement.target.object):
            if scene.file is None:
                return target_light(lit, spec.target, stream, where, root, alone=alone)
            check_lights_differ(scene.file.lights, spec.target, number, where)
            return scene_light(lit, scene_facts(scene.room, root).lights, scene.file.lights, spec.target, stream,
                               where, root / scene.file.path, root, alone)

    def example(self, ref: ExampleRef) -> ExamplePlan:
        """The plan of one example. Raises PlanError where the spec asks for what cannot be."""
        spec, shared = self.loaded.dataset, self.view(ref.view)
        light, note = self.light(ref.view, ref.light)
        arrangement = shared.arrangement
        render = render_plan(spec, ref.view, from_file=arrangement.room.kind != "procedural")
        fog, levels = self._scene(ref.view.pair).fog, spec.split_of(ref.view.pair.split).levels(spec.rough)
        effects = plan_effects(spec=spec.render, room=arrangement.room, shell=arrangement.shell,
                               camera=shared.view.camera,
                               target=arrangement.target, furniture=arrangement.furniture,
                               source_light=shared.source, target_light=light, fog=fog, render=render,
                               mesh_root=self.loaded.path.parent, where=_where(ref.view, arrangement),
                               field=shared.field, taken=any(isinstance(level, FieldSpec) for level in levels))
        asset = asset_of(arrangement.target.object, self.loaded.path.parent)
        clean = asset.mesh
        level = levels[ref.level]
        taken = field_plan(spec, level if isinstance(level, FieldSpec) else None, ref.view.pair,
                           arrangement.target.object, self.loaded.path.parent)
        rough = rough_of_field(spec, ref, taken) if taken.there else rough_plan(spec, ref, level, clean)
        return ExamplePlan(
            schema_version=SCHEMA_VERSION, key=ref.key, index=ref.index, split=ref.view.pair.split, view=ref.view.name,
            light=ref.light, room=arrangement.room, target=arrangement.target, furniture=arrangement.furniture,
            camera=shared.view.camera, sequence=sequence_of(spec, ref.view), source_light=shared.source,
            target_light=light, rough=rough, fog=fog, field=shared.field, render=render, effects=effects,
            notes=(*arrangement.notes, shared.view.note, note, *rough_notes(rough, clean),
                   *field_notes((shared.field, rough.field), asset)))


def _bytes_of(arrangement: Arrangement) -> int:
    return TRIANGLE_BYTES * sum(len(faces) for _, faces, _ in arrangement.geometry)


def _where(ref: ViewRef, arrangement: Arrangement) -> str:
    return f"{ref.name} ({arrangement.target.object.name} in {arrangement.room.name})"


def layers_asked(spec: DatasetSpec) -> tuple[tuple[str, Extent], ...]:
    """Layers and their extents in the order of the spec, with standard errors after them where storage wants them."""
    asked: dict[str, Extent] = dict(spec.layers)
    if spec.render.denoise.keep_raw:
        asked |= {f"{name}_raw": spec.layers[name] for name in spec.render.denoise.layers}
    if spec.storage.standard_errors:
        for name, extent in spec.layers.items():
            if f"{name}_se" in LAYERS:
                asked.setdefault(f"{name}_se", extent)
    return tuple(asked.items())


def render_plan(spec: DatasetSpec, view: ViewRef, *, from_file: bool = False) -> RenderPlan:
    """How the pixels of a view are computed. from_file: whether its scene is one of a file."""
    render = spec.render
    goals = tuple(GoalPlan(layer=name, error=goal.error or 0.0, seconds=goal.seconds or 0.0, cap=goal.cap)
                  for name in render.accuracy for goal in render.goals(name))
    parts = tuple(SppPart(render_pass=name, spp=spp) for name in SppSpec.model_fields
                  for spp in render.spp.parts(name) if len(render.spp.parts(name)) > 1)
    return RenderPlan(width=spec.image.width, height=spec.image.height, layers=layers_asked(spec),
                      spp_first_hit=render.spp.total("first_hit"), spp_source=render.spp.total("source"),
                      spp_target=render.spp.total("target"), spp_rough=render.spp.total("rough"), spp_parts=parts,
                      batches=render.batches, goals=goals, rr_depth=render.rr_depth, texture_size=render.texture_size,
                      texels_per_pixel=TEXELS_PER_PIXEL if from_file else 0.0,
                      denoise=render.denoise.layers, keep_raw=render.denoise.keep_raw,
                      seed=str(derive_seed(spec.seed, *view.path, "render")))


def plan_example(loaded: LoadedSpec, index: int, planner: Planner | None = None) -> ExamplePlan:
    """The plan of example `index`, equal to the one in the whole; a planner of the same spec saves repeated work.

    Raises PlanError where there is no such example or where it cannot be planned.
    """
    planner = planner or Planner(loaded)
    if not 0 <= index < len(planner.examples):
        rule = f"expected an example in [0, {len(planner.examples)}), got {index}"
        raise PlanError([Problem(where="", path="example", rule=rule)])
    return planner.example(planner.examples[index])


def first_plan(planner: Planner, most: int = 32) -> ExamplePlan | None:
    """The plan of the first example that can be planned, among the first `most`; None where none of these can."""
    for ref in planner.examples[:most]:
        with suppress(PlanError):
            return planner.example(ref)
    return None
