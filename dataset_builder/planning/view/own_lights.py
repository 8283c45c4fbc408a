"""The lights that a scene file has, as its spec wants them: dimmed, none of them absurd, one dome at most."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder.assets.light_bounds import MOST_METRES, bounded
from dataset_builder.assets.scene_model import SceneLight
from dataset_builder.errors import PlanError, Problem, UserError
from dataset_builder.label.scene_plan import LightPlan
from dataset_builder.light_kinds import LIGHT_KINDS
from dataset_builder.planning.view.emission import LUMINANCE
from dataset_builder.spec.name_patterns import fits

MOST_LIGHTS = 1024
"""As many as a spec may draw."""
TOLD = 6
"""Lights that a message names."""


@dataclass(frozen=True, kw_only=True)
class OwnLights:
    """The lights of a scene file that shine."""

    lights: tuple[SceneLight, ...]
    """In the units of the file."""
    said: tuple[str, ...]
    """What became of the others, and of these, in words."""

    @property
    def plans(self) -> tuple[LightPlan, ...]:
        """The lights without their names."""
        return tuple(each.light for each in self.lights)


def own_lights(lights: Sequence[SceneLight], dim: Mapping[str, float], scene: Path) -> OwnLights:
    """The lights of a scene that shine once they are dimmed; of several domes only one does.

    scene: its file, for messages. Raises PlanError, with file and light, for numbers that no light has, and for more
    lights than a scene may have. That every pattern of `dim` fits one is looked at with the spec.
    """
    shining, said = list[SceneLight](), list[str]()
    for each in lights:
        _check(each, scene)
        factor = next((factor for pattern, factor in reversed([*dim.items()]) if fits(each.name, pattern)), 1.0)
        made = times(each.light, factor)
        if not any(made.radiance):
            said.append(f"{each.name} is off" if factor == 0 else f"{each.name} sends nothing")
            continue
        if factor != 1:
            said.append(f"{each.name} dimmed to {factor:g}")
        shining.append(SceneLight(name=each.name, light=made))
    kept, merged = one_dome(shining)
    if len(kept) > MOST_LIGHTS:
        raise refused(scene, "lights", f"expected at most {MOST_LIGHTS} lights, got {len(kept)}",
                      "switch some off with `lights.dim`")
    return OwnLights(lights=kept, said=(*said, *merged))


def times(light: LightPlan, factor: float) -> LightPlan:
    """A light that sends `factor` times as much."""
    x, y, z = light.radiance
    return light if factor == 1 else light.model_copy(update={"radiance": (x * factor, y * factor, z * factor)})


def one_dome(lights: Sequence[SceneLight]) -> tuple[tuple[SceneLight, ...], list[str]]:
    """The lights with one dome at most, and what was decided: even domes add up, of others the brightest is kept."""
    domes = [each for each in lights if LIGHT_KINDS[each.light.kind].all_round]
    if len(domes) < 2:
        return tuple(lights), []
    even = [each for each in domes if not each.light.image]
    said, candidates = list[str](), [each for each in domes if each.light.image]
    if even:
        total = np.sum([each.light.radiance for each in even], axis=0)
        weight = sum(each.light.weight for each in even)
        merged = even[0].light.model_copy(update={"radiance": tuple(total.tolist()), "weight": weight})
        candidates.append(SceneLight(name=even[0].name, light=merged))
        if len(even) > 1:
            said.append(f"even domes add up: {named(each.name for each in even)}")
    best = max(candidates, key=lambda each: float(np.array(each.light.radiance) @ LUMINANCE))
    lost = [each.name for each in candidates if each is not best]
    if lost:
        said.append(f"one dome, {best.name}, the brightest; left out: {named(lost)}")
    place = next(index for index, each in enumerate(lights) if each in domes)
    others = [each for each in lights if each not in domes]
    return (*others[:place], best, *others[place:]), said


def named(names: Iterable[str]) -> str:
    """Names, the first few of many."""
    every = list(names)
    return ", ".join(every[:TOLD]) + (f" and {len(every) - TOLD} more" if len(every) > TOLD else "")


def refused(scene: Path, path: str, rule: str, hint: str = "") -> PlanError:
    """The error about a scene file."""
    return PlanError([Problem(where=str(scene), path=path, rule=rule, hint=hint)])


def _check(each: SceneLight, scene: Path) -> None:
    """Raise PlanError for numbers that no light has, whatever reader they are from."""
    light = each.light
    try:
        for value in light.radiance:
            bounded(scene, each.name, "brightness", value)
        for value in (light.size, light.length):
            bounded(scene, each.name, "size", value, high=MOST_METRES)
        for value in (*light.position, *light.direction):
            bounded(scene, each.name, "place", value, low=-MOST_METRES, high=MOST_METRES)
    except UserError as error:
        raise PlanError(error.problems) from error
