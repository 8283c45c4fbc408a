"""Which effects each pass of an example simulates, decided from its plan and its materials, before rendering.

Every decision has a reason in words. Nothing here draws, renders or looks at pixels; `docs/effects.md` has the rules.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.example_plan import Decision, EffectsPlan, Feature, PassEffects, RenderPlan
from dataset_builder.label.field_plan import NO_FIELD, FieldPlan
from dataset_builder.label.scene_plan import (
    CameraPlan,
    FogPlan,
    IlluminationPlan,
    PlacedObject,
    PortalPlan,
    RoomPlan,
    Vector,
)
from dataset_builder.layers import LIT, PASSES
from dataset_builder.planning.effects.caustics_told import throws_caustics, told
from dataset_builder.planning.effects.daylight_choice import daylight
from dataset_builder.planning.effects.features import scene_features
from dataset_builder.planning.effects.light_left import MAX_DEPTH, LightLeft, light_left
from dataset_builder.planning.effects.materials_used import MaterialUse, SceneUse, scene_use
from dataset_builder.planning.effects.pass_extents import extent_of_pass, light_free, most_spp, runs
from dataset_builder.planning.effects.reach import bends, path_depth, reaching, said
from dataset_builder.planning.effects.transport_choice import PassLight, choose, choose_for_everything
from dataset_builder.planning.scene.shell import Shell
from dataset_builder.spec.render import RenderSpec

FIELDS = {"density": "a neural field of the object (volume density)",
          "sdf": "a neural field of the object (signed distance)", "own": "the object's own capture"}
"""Fields as decisions name them."""
FACTOR = 16
"""How many times the dataset's spp a reference has that denoised layers are measured against: a quarter of the noise.
"""
REPEATS = 2
"""Independent renders of such an example as the dataset asks: their products hold the bias without the noise."""
DEEP = 128
"""Least number of edges where everything is simulated."""


@dataclass(frozen=True, kw_only=True)
class _Scene:
    """What decisions about the passes of one example are made from."""

    spec: RenderSpec
    shell: Shell
    near: Vector
    """Where the target stands."""
    use: SceneUse
    light: dict[str, IlluminationPlan]
    fog: FogPlan
    render: RenderPlan
    target_area: float
    """Its surface, square metres."""
    field: FieldPlan
    """What the source pass sees, where it is no mesh."""
    left: Callable[[str, Sequence[int]], LightLeft]
    """What longer paths would bring to a pass with some of its lights."""
    where: str
    """The view, as errors name it."""


def plan_effects(*, spec: RenderSpec, room: RoomPlan, shell: Shell, camera: CameraPlan, target: PlacedObject,
                 furniture: tuple[PlacedObject, ...], source_light: IlluminationPlan, target_light: IlluminationPlan,
                 fog: FogPlan, render: RenderPlan, mesh_root: Path, where: str = "",
                 field: FieldPlan = NO_FIELD, taken: bool = False) -> EffectsPlan:
    """What is simulated for one example, with reasons. where: the view, as errors name it. field: what `i_s` shows in
    place of the mesh. taken: whether R3DMs of the view are taken from fields.

    Features, and what the light-free and source passes simulate, follow from the view alone: no target light changes
    them. Raises PlanError where a mesh file is not the one that was planned, where no light of a pass that runs can
    reach the object, and where fog is so dense that no path planned is long enough.
    """
    light: dict[str, IlluminationPlan] = {name: source_light if name.startswith("source") else target_light
                                          for name in LIT}
    seen = {"source"} if field.there else set()
    _require_light(shell, target.position, light, [name for name in LIT if runs(render, name) and name not in seen],
                   where)
    if spec.effects == "all":
        return _everything(spec, render, light)
    use = scene_use(room, (target, *furniture), mesh_root)

    def left(name: str, kept: Sequence[int]) -> LightLeft:
        alike = [each for each in LIT if each.startswith("source") == name.startswith("source")
                 and each not in seen and runs(render, each)]
        glass = bends(use.materials)
        share = max(fog.albedo * (fog.extinction > 0), float(glass), *(one.scattered for one in use.materials))
        return light_left(room=room, target=target, furniture=furniture, light=light[name], fog=fog, camera=camera,
                          kept=[light[name].lights[index] for index in kept], render=render, passes=alike,
                          bias=spec.bias, share=share, glass=glass,
                          mesh_root=mesh_root)

    scene = _Scene(spec=spec, shell=shell, near=target.position, use=use, light=light, fog=fog, render=render,
                   target_area=use.area_of(target.object.name), field=field, left=left, where=where)
    planned = [_plan_pass(scene, name) for name in PASSES]
    features, on_surfaces = scene_features(use, fog, render, taken)
    lit = [(each.light, each.entry.transport) for each in planned if each.light and runs(render, each.light.name)]
    decisions = (*(decision for each in planned for decision in each.decisions), *told(lit), *light_free(render),
                 *on_surfaces)
    return EffectsPlan(features=features, passes=tuple(each.entry for each in planned), decisions=decisions)


def _everything(spec: RenderSpec, render: RenderPlan, light: dict[str, IlluminationPlan]) -> EffectsPlan:
    depth = DEEP if spec.max_depth == "auto" else max(int(spec.max_depth), DEEP)
    lit = {name: tuple(range(len(illumination.lights))) for name, illumination in light.items()}
    reason = "everything simulated, as requested"
    paths = {name: choose_for_everything(name, spec.transport, reason) for name in LIT}
    passes = tuple(PassEffects(name=name, extent="frame", lights=lit.get(name, ()), max_depth=depth,
                               transport=paths[name][0] if name in paths else "camera") for name in PASSES)
    decisions = (*(Decision(effect=f"pass {name}", choice="frame" if runs(render, name) else "not run", reason=reason)
                   for name in PASSES),
                 *(Decision(effect=f"lights of {name}", choice="all", reason=reason) for name in LIT),
                 *(Decision(effect=f"path depth of {name}", choice=f"{depth}", reason=reason) for name in LIT),
                 *(on_transport for name, (_, on_transport) in paths.items() if runs(render, name)),
                 *(Decision(effect=feature, choice="on", reason=reason) for feature in get_args(Feature)))
    return EffectsPlan(features=get_args(Feature), passes=passes, decisions=decisions)


@dataclass(frozen=True, kw_only=True)
class _Planned:
    """One pass, and why it is as it is."""

    entry: PassEffects
    decisions: tuple[Decision, ...]
    light: PassLight | None = None
    """None where it needs no light."""


def _plan_pass(scene: _Scene, name: str) -> _Planned:
    extent, about = extent_of_pass(scene.render, name)
    running = runs(scene.render, name)
    on_pass = Decision(effect=f"pass {name}", choice=extent if running else "not run", reason=about)
    if name == "source" and scene.field.there:
        shown = FIELDS[scene.field.kind]
        reason = f"i_s is the image of {shown}, seen alone, in the light that it was made in"
        return _Planned(entry=_entry(name, "object", max_depth=1),
                        decisions=(Decision(effect=f"pass {name}", choice="field" if running else "not run",
                                            reason=reason if running else about),))
    if name not in LIT:
        return _Planned(entry=_entry(name, extent, max_depth=1), decisions=(on_pass,))
    kept, on_lights = _lights(scene, name)
    depth, on_depth = _depth(scene, name, kept)
    light = PassLight(name=name, lights=tuple(scene.light[name].lights[index] for index in kept),
                      materials=_standing(scene, name), fog=scene.fog, depth=depth, target_area=scene.target_area,
                      place=scene.near, pixels=scene.render.width * scene.render.height,
                      spp=most_spp(scene.render, name), batches=scene.render.batches)
    transport, on_transport = choose(light, scene.spec.transport)
    portals, on_daylight = _daylight(scene, name, kept)
    entry = _entry(name, extent, lights=kept, max_depth=depth, transport=transport, portals=portals,
                   caustics=transport == "joined" and throws_caustics(light))
    decisions = (on_pass, on_lights, on_depth, *on_daylight, on_transport) if running else (on_pass,)
    return _Planned(entry=entry, light=light, decisions=decisions)


def _entry(name: str, extent: str, **more: Any) -> PassEffects:
    return PassEffects.model_validate({"name": name, "extent": extent, "lights": (), **more})


# Lights and paths

def _lights(scene: _Scene, name: str) -> tuple[tuple[int, ...], Decision]:
    lights = scene.light[name].lights
    found = reaching(scene.light[name], scene.shell, scene.near)
    kept = tuple(index for index, each in enumerate(found) if each.kept)
    return kept, Decision(effect=f"lights of {name}", choice=f"{len(kept)} of {len(lights)}",
                          reason=said(lights, found) or "there are none")


def _daylight(scene: _Scene, name: str, kept: Sequence[int]) -> tuple[tuple[PortalPlan, ...], list[Decision]]:
    light = scene.light[name]
    return daylight(name, [light.lights[index] for index in kept], scene.shell, light.open, scene.near)


def _require_light(shell: Shell, near: Vector, light: dict[str, IlluminationPlan], running: Sequence[str],
                   where: str) -> None:
    """Raise PlanError for every pass of those running that would run in the dark."""
    problems = []
    for name in running:
        found = reaching(light[name], shell, near)
        if not any(each.kept for each in found):
            why = said(light[name].lights, found) or "there are none"
            rule = f"expected a light that reaches the object in the pass {name}, got none: {why}"
            problems.append(Problem(where=where, path="source" if name.startswith("source") else "target", rule=rule,
                                    hint=shell.brighter))
    if problems:
        raise PlanError(problems)


def _standing(scene: _Scene, name: str) -> tuple[MaterialUse, ...]:
    """Materials of what is not taken away in a pass."""
    opened = scene.light[name].open
    return tuple(use for use in scene.use.materials if use.part not in opened)


def _depth(scene: _Scene, name: str, kept: Sequence[int]) -> tuple[int, Decision]:
    left = scene.left(name, kept)
    found = path_depth(scene.spec.max_depth, scene.spec.bias, _standing(scene, name), scene.fog, left)
    missing = float(left.share[MAX_DEPTH])
    if scene.fog.extinction and left.paths and missing > scene.spec.bias and scene.spec.max_depth == "auto":
        rule = (f"expected fog that paths of at most {MAX_DEPTH} edges get through, got an extinction of "
                f"{scene.fog.extinction:g} per metre and an albedo of {scene.fog.albedo:g}: longer ones would bring "
                f"about {missing:.0%} of the light of the pass {name}")
        raise PlanError([Problem(where=scene.where, path="fog", rule=rule, hint="take thinner or darker fog, allow a "
                                 "larger `render.bias`, or set `render.max_depth` and lose that light")])
    return found.depth, Decision(effect=f"path depth of {name}", choice=str(found.depth), reason=found.reason)
