"""What the parts of a procedural room are finished with, where its spec says so: drawn, and made."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from dataset_builder.assets.asset import Material, Texture
from dataset_builder.assets.image_maps import ImageFile, make_texture, read_texels
from dataset_builder.assets.procedural.materials import FAMILIES_OF_FINISHES, WHITE
from dataset_builder.assets.procedural.parts import Finish
from dataset_builder.digest import sha256_file
from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.scene_plan import RoomMaterialPlan, RoomPlan
from dataset_builder.planning.scene.material_changes import applied, drawn_values
from dataset_builder.seeding import rng
from dataset_builder.spec.numbers import draw
from dataset_builder.spec.problems import nearest, shown
from dataset_builder.spec.scene import RoomMaterialSpec, RoomRole

MAX_TEXTURE = 1024
"""Longest side of a texture in texels, as of mesh files."""


def room_materials(spec: Mapping[RoomRole, RoomMaterialSpec], images: Mapping[str, str], seed: int,
                   path: tuple[str | int, ...], where: str) -> tuple[RoomMaterialPlan, ...]:
    """Draw what a room spec says of its materials, each number from a path of its own below `path`.

    images: SHA-256 of textures by name. Raises PlanError, naming the room file `where`, for tones that a family does
    not have.
    """
    return tuple(_drawn(role, own, images, seed, (*path, role), where) for role, own in spec.items())


def _drawn(role: str, own: RoomMaterialSpec, images: Mapping[str, str], seed: int, path: tuple[str | int, ...],
           where: str) -> RoomMaterialPlan:
    tones = list(FAMILIES_OF_FINISHES[own.family][1]) if own.family else []
    if own.tone and own.tone not in tones:
        raise PlanError([Problem(where=where, path=f"materials.{role}.tone", hint=nearest(own.tone, tones, "tone"),
                                 rule=f"expected a tone of {own.family}, got {shown(own.tone)}")])
    return RoomMaterialPlan(name=role, values=drawn_values(own, seed, path), family=own.family or "", tone=own.tone,
                            image=own.texture, image_sha256=images[own.texture] if own.texture else "",
                            size=draw(own.size, rng(seed, *path, "size")) if own.texture else 0.0)


def finished(plan: RoomPlan, root: Path, role: str, drawn: Finish) -> Finish:
    """The finish of a part of a planned room, from the one that is drawn for it. root: folder of the dataset file.

    Raises PlanError where its texture is not the one that was planned, UserError where it cannot be read.
    """
    own = next((each for each in plan.materials if each.name == role), None)
    if own is None:
        return drawn
    finish = _plain(own, drawn)
    if own.family:
        make, _ = FAMILIES_OF_FINISHES[own.family]
        finish = make(rng(int(plan.seed), "room", "material", role), own.tone or None)
    elif own.image:
        material = replace(drawn.material, name=own.image, base_color=WHITE, texture=_texture(root / own.image, own))
        finish = Finish(material=material, repeat=own.size)
    return replace(finish, material=applied(finish.material, [own]))


def _plain(own: RoomMaterialPlan, drawn: Finish) -> Finish:
    """The drawn finish, without its texture where a colour takes the place of it."""
    coloured = any(param.name == "base_color.0" for param in own.values)
    material: Material = drawn.material
    return replace(drawn, material=replace(material, name="colour", texture=None) if coloured else material)


def _texture(path: Path, own: RoomMaterialPlan) -> Texture | None:
    try:
        found = sha256_file(path)
    except OSError as error:
        raise PlanError([Problem(where=str(path), path="", rule=f"expected a readable image, got: {error.strerror}",
                                 hint="put it back")]) from error
    if found != own.image_sha256:
        raise PlanError([Problem(where=str(path), path="", rule=f"expected content of SHA-256 {own.image_sha256}, got "
                                 f"{found}", hint="the file changed after planning; plan again")])
    texels = read_texels(ImageFile(name=str(path), content=path), srgb=True, max_size=MAX_TEXTURE, opaque=True)
    return make_texture({"base_color": texels[..., :3]})
