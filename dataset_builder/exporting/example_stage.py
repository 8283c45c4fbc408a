"""An example -> the prims of its stage.

    /Example             variant set `illumination`: source, target
      Target             variant set `geometry`: 3DM, R3DM
      Room/floor ...     parts of the building; those that the source light opens are invisible in that variant
      Furniture/...      one prim for each piece
      Camera, Lights, Layers, Materials
"""

from dataclasses import dataclass
from math import radians, tan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dataset_builder.digest import canonical_json
from dataset_builder.exporting.light_prims import LightWriter
from dataset_builder.exporting.mesh_prims import write_mesh
from dataset_builder.exporting.placed_things import PlacedThing, StageContents, prim_name
from dataset_builder.exporting.preview_surfaces import SurfaceWriter
from dataset_builder.exporting.texel_files import TexelFiles
from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.label.example_label import ExampleLabel
from dataset_builder.rendering.pass_inputs import sky_radiance
from dataset_builder.rendering.scene.triangle_soup import Soup

if TYPE_CHECKING:
    from pxr import Usd

ROOT = "/Example"
FOCAL_LENGTH = 0.35
"""Of the camera, in tenths of a metre as USD has it: 35 mm. Only its ratio to the apertures means anything."""
NEAR, FAR = 1e-3, 1e4
"""What the camera clips, metres."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StageParts:
    """What a stage is made of."""

    label: ExampleLabel
    contents: StageContents
    layers: tuple[tuple[str, str], ...]
    """Names of layers, with their files relative to the stage."""
    mesh_root: Path


def write_stage(path: Path, parts: StageParts) -> tuple[str, ...]:
    """Write the stage, and its textures beside it; what could not be said, in words.

    Raises PlanError where an image of a light is not the one that was planned.
    """
    from pxr import Kind, Usd, UsdGeom

    plan, stage, files = parts.label.plan, Usd.Stage.CreateNew(str(path)), TexelFiles(folder=path.parent)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, ROOT).GetPrim()
    stage.SetDefaultPrim(root)
    Usd.ModelAPI(root).SetKind(Kind.Tokens.assembly)
    for scope in ("Lights", "Layers", "Materials"):
        UsdGeom.Scope.Define(stage, f"{ROOT}/{scope}")
    surfaces = SurfaceWriter(stage=stage, scope=f"{ROOT}/Materials", files=files, sky=sky_radiance(plan))
    _target(stage, parts.contents, surfaces)
    building = _around(stage, parts.contents, surfaces)
    _camera(stage, parts.label)
    lights = LightWriter(stage=stage, scope=f"{ROOT}/Lights", files=files, image_root=parts.mesh_root)
    lost = _illumination(stage, parts.label, lights, building)
    _layers(stage, parts.layers)
    lost += [f"{what}: {', '.join(sorted(set(names)))}" for what, names in sorted(surfaces.lost.items())]
    if plan.fog.extinction:
        lost.append(f"fog of extinction {plan.fog.extinction:g} per metre")
    if plan.field.there:
        lost.append("the field that i_s is the image of")
    _label(root, parts, tuple(lost))
    stage.GetRootLayer().Save()
    return tuple(lost)


def _target(stage: "Usd.Stage", contents: StageContents, surfaces: SurfaceWriter) -> None:
    from pxr import Usd

    prim = _thing(stage, f"{ROOT}/Target", contents.target)
    variants = prim.GetVariantSets().AddVariantSet("geometry")
    meshes: dict[str, Soup] = {"R3DM": contents.rough, "3DM": contents.target.soup}
    for name, soup in meshes.items():
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        # Materials are the same in every variant, and stand outside of all
        for index in np.unique(soup.material):
            surfaces.material(soup.materials[index])
        with Usd.EditContext(stage, variants.GetVariantEditTarget()):
            write_mesh(stage, f"{prim.GetPath()}/{prim.GetName()}_mesh", soup, surfaces)


def _around(stage: "Usd.Stage", contents: StageContents, surfaces: SurfaceWriter) -> dict[str, Any]:
    """Write parts of the building and furniture; prims of the former by the names of the parts."""
    from pxr import Kind, Usd, UsdGeom

    for group in ("Room", "Furniture"):
        Usd.ModelAPI(UsdGeom.Xform.Define(stage, f"{ROOT}/{group}")).SetKind(Kind.Tokens.group)
    building, taken = dict[str, Any](), set[str]()
    for thing in contents.around:
        name = prim_name(thing.name.rpartition("/")[2], taken)
        taken.add(name)
        prim = _thing(stage, f"{ROOT}/{'Room' if thing.part else 'Furniture'}/{name}", thing)
        write_mesh(stage, f"{prim.GetPath()}/{prim.GetName()}_mesh", thing.soup, surfaces)
        if thing.part:
            building[thing.part] = prim
    return building


def _thing(stage: "Usd.Stage", path: str, thing: PlacedThing) -> "Usd.Prim":
    """The prim that a mesh goes below."""
    from pxr import Gf, Kind, Usd, UsdGeom, UsdSemantics

    made = UsdGeom.Xform.Define(stage, path)
    made.AddTransformOp().Set(Gf.Matrix4d(thing.world.T.tolist()))
    prim = made.GetPrim()
    Usd.ModelAPI(prim).SetKind(Kind.Tokens.component)
    if thing.category:
        UsdSemantics.LabelsAPI.Apply(prim, "category").CreateLabelsAttr([thing.category])
    for key, value in {"name": thing.name, "category": thing.category, "licence": thing.licence,
                       "instance": thing.instance}.items():
        prim.SetCustomDataByKey(key, value)
    return prim


def _camera(stage: "Usd.Stage", label: ExampleLabel) -> None:
    from pxr import Gf, UsdGeom

    plan, render = label.plan.camera, label.plan.render
    camera = Pinhole.of(plan, render.width, render.height)
    made = UsdGeom.Camera.Define(stage, f"{ROOT}/Camera")
    made.AddTransformOp().Set(Gf.Matrix4d(camera.opengl_pose.T.tolist()))
    width = 2 * FOCAL_LENGTH * tan(radians(plan.fov) / 2)
    made.CreateProjectionAttr(UsdGeom.Tokens.perspective)
    made.CreateFocalLengthAttr(FOCAL_LENGTH)
    made.CreateHorizontalApertureAttr(width)
    made.CreateVerticalApertureAttr(width * camera.aspect)
    made.CreateClippingRangeAttr(Gf.Vec2f(NEAR, FAR))
    made.CreateFocusDistanceAttr(float(np.linalg.norm(camera.target - camera.position)))


def _illumination(stage: "Usd.Stage", label: ExampleLabel, lights: LightWriter, building: dict[str, Any]) -> list[str]:
    """Write both illuminations as variants of the root, since they reach lights and the building."""
    from pxr import Usd, UsdGeom

    variants, lost = stage.GetDefaultPrim().GetVariantSets().AddVariantSet("illumination"), dict[str, None]()
    for name, light in (("source", label.plan.source_light), ("target", label.plan.target_light)):
        variants.AddVariant(name)
        variants.SetVariantSelection(name)
        with Usd.EditContext(stage, variants.GetVariantEditTarget()):
            lost |= dict.fromkeys(lights.write(light))
            for part in light.open:
                if part in building:
                    UsdGeom.Imageable(building[part]).CreateVisibilityAttr(UsdGeom.Tokens.invisible)
    return list(lost)


def _layers(stage: "Usd.Stage", layers: tuple[tuple[str, str], ...]) -> None:
    from pxr import Sdf

    prim = stage.GetPrimAtPath(f"{ROOT}/Layers")
    for name, path in layers:
        prim.CreateAttribute(f"layers:{name}", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(f"./{path}"))


def _label(root: "Usd.Prim", parts: StageParts, lost: tuple[str, ...]) -> None:
    """The label as JSON, and beside it what people look for first."""
    from pxr import Vt

    plan, things = parts.label.plan, (parts.contents.target, *parts.contents.around)
    found: dict[str, Any] = {
        "key": plan.key, "split": plan.split, "view": plan.view, "light": plan.light, "width": plan.render.width,
        "height": plan.render.height, "roughness": plan.rough.sigma, "skyRadiance": sky_radiance(plan),
        "licences": Vt.StringArray(sorted({thing.licence for thing in things})), "notSaid": Vt.StringArray(list(lost)),
        "label": canonical_json(parts.label.model_dump(mode="json")).decode()}
    for key, value in found.items():
        root.SetCustomDataByKey(key, value)
