"""The materials of a scene that some face has, with bounds on how much light they scatter."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from dataset_builder.assets.asset import (
    Asset,
    Material,
    coverage_range,
    range_of,
    texel_ends,
    vertex_alphas,
)
from dataset_builder.assets.file_model import NO_MATERIAL
from dataset_builder.geometry.edges import CREASE_ANGLE, consistent, dihedral_angles, edges_of
from dataset_builder.label.scene_plan import PlacedObject, RoomPlan
from dataset_builder.planning.effects.nested_glass import unowned_glass
from dataset_builder.planning.scene.assets_of_plan import asset_of, world_from_object
from dataset_builder.planning.scene.room_parts import room_parts
from dataset_builder.planning.scene.scene_models import scene_model

SCHLICK_MEAN = 1 / 21
"""Integral of 2 c (1 - c)^5 over cosines c: mean of Schlick's term for light from everywhere."""
COAT_F0 = 0.04
STEPS = 256
SMOOTH = 0.0316
"""Roughness below which glass sends light in single directions: GGX alpha of 1e-3, as rendering has it."""
TOLD = {"contains": "contains", "left_out": "left out", "repair": "repair", "shape": "shape"}
"""Choices of decisions about mesh files, by the key of the asset's `meta`."""
SENTENCES, THINGS = 40, 6
"""Of what a scene file leaves out or has wrong, and of things about which there is something to say: how many one
decision lists before it counts the rest."""
FLAT = 0.01
"""Degrees below which two faces are in one plane."""


def mean_schlick(f0: np.ndarray) -> np.ndarray:
    """(..., 3) reflectance of a specular lobe for light from everywhere; roughness only lowers it, with what facets
    scatter again.

    Schlick's term with the F90 of `rendering.surface`, averaged over the hemisphere.
    """
    f90 = np.minimum(50 * f0.max(axis=-1, keepdims=True), 1)
    return f0 + (f90 - f0) * SCHLICK_MEAN


def glass_share(ior: float, thin: bool) -> float:
    """Share of light from everywhere outside that glass reflects: Fresnel's F, or 2 F / (1 + F) for the two faces of a
    pane, by midpoints over the squared cosine."""
    cosine = np.sqrt((np.arange(STEPS) + 0.5) / STEPS)
    inside = np.sqrt(1 - (1 - cosine**2) / ior**2)
    across = (cosine - ior * inside) / (cosine + ior * inside)
    along = (ior * cosine - inside) / (ior * cosine + inside)
    face = (across**2 + along**2) / 2
    return float(np.mean(2 * face / (1 + face) if thin else face))


def scattered_share(material: Material, vertices: Sequence[float] | np.ndarray = (1.0, 1.0, 1.0)) -> float:
    """Largest share of light from everywhere that a material scatters, over channels, texels and its lobes. vertices:
    largest red, green and blue of its vertices.

    In [0, 1]. What goes into glass or back inside it is not in it: that goes on as it came and counts as crossings.
    """
    base = np.asarray(material.base_color) * np.asarray(vertices) * texel_ends(material.texture, "base_color")[1]
    low, high = range_of(material, "metallic")
    # What is opaque scatters most at one of them: 1 - that is a product of two lines
    opaque = np.maximum(_opaque(material, base, low), _opaque(material, base, high))
    least, most = range_of(material, "transmission")
    glass = glass_share(material.ior, material.thin) if most else 0.0
    share = np.maximum(opaque + least * (1 - high) * np.minimum(glass - opaque, 0), glass)
    return float(np.clip(_layered(material, share).max(), 0, 1))


def _opaque(material: Material, base: np.ndarray, metallic: float) -> np.ndarray:
    """(3,) diffuse base under its specular lobe, which passes on what it does not reflect."""
    specular = mean_schlick((1 - metallic) * material.specular + metallic * base)
    return specular + base * (1 - metallic) * (1 - specular)


def _layered(material: Material, share: np.ndarray) -> np.ndarray:
    """(3,) share under sheen, under a coat; each passes on what it does not reflect, and sheen reflects at most all."""
    sheen = np.asarray(material.sheen)
    share = np.maximum(share, sheen + share * (1 - sheen.max()))
    coat = material.coat * mean_schlick(np.full(1, COAT_F0))
    return coat + (1 - coat) * share


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialUse:
    """One material that at least one face shows."""

    owner: str
    """Name of the object or thing, or of the part of the room."""
    part: str
    """`furniture`, or a part of the room."""
    material: Material
    scattered: float
    """Largest share of light that it scatters, see `scattered_share`."""
    smoothest: float
    """Least roughness over its texels."""
    roughest: float
    """Largest roughness over its texels."""
    coverage: tuple[float, float] = (1.0, 1.0)
    """Least and largest share of it that is there, over texels and vertices."""
    coloured: bool = False
    """Whether vertices have colours."""
    area: float = 0.0
    """Of the faces that show it, square metres; where they are stretched unevenly, as if evenly to the same volume."""

    @property
    def name(self) -> str:
        """As reasons name it: `top: oak of train-table-00`."""
        named = f"'{NO_MATERIAL}'" if self.material.name == NO_MATERIAL else self.material.name
        return f"{named} of {self.owner if self.part == 'furniture' else f'the {self.part}'}"


def is_smooth(roughness: float) -> bool:
    """Whether glass of a roughness has no lobe of any width."""
    return roughness <= SMOOTH


@dataclass(frozen=True, kw_only=True, eq=False)
class _Facts:
    """What one asset shows."""

    materials: tuple[Material, ...]
    figures: tuple[dict[str, Any], ...]
    """Of each material, fields of `MaterialUse`; areas in the asset's own frame."""
    smooth: bool
    """Whether normals bend."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneUse:
    """All that stands in a scene."""

    materials: tuple[MaterialUse, ...]
    smooth: tuple[str, ...]
    """Names of things whose shading normals are smooth."""
    flat: tuple[str, ...]
    """Names of all others."""
    files: tuple[tuple[str, str], ...] = ()
    """Pairs of a word and a sentence, of every mesh file: see `told_of`."""
    scene: tuple[tuple[str, str], ...] = ()
    """The same of the scene file, one of each word; empty for a room in code."""
    unowned: tuple[str, ...] = ()
    """Bodies of glass that take the same space, see `nested_glass.unowned_glass`."""

    def area_of(self, name: str) -> float:
        """Surface of a thing, square metres."""
        return sum(use.area for use in self.materials if use.part == "furniture" and use.owner == name)


def told_of(asset: Asset) -> list[tuple[str, str]]:
    """Of a mesh file, pairs of a word and a sentence: what it contains, and where there is something to say, what of
    that was left out, what was mended, and what is wrong with its shape."""
    return [(word, asset.meta[key]) for key, word in TOLD.items() if asset.meta.get(key)]


_known: WeakKeyDictionary[Asset, _Facts] = WeakKeyDictionary()


def _facts(asset: Asset) -> _Facts:
    """The facts of an asset, found once for as long as it is kept."""
    if asset not in _known:
        faces = np.unique(asset.mesh.material).tolist()
        areas = np.bincount(asset.mesh.material, np.linalg.norm(asset.mesh.area_normals, axis=1) / 2)
        shown = tuple(asset.materials[index] for index in faces)
        alphas, colors = vertex_alphas(asset.mesh.material, asset.mesh.colors), asset.mesh.colors
        figures = tuple(_figures(asset.materials[index], alphas.get(index), (1.0, 1.0, 1.0) if colors is None else
                                 colors[asset.mesh.material == index, :, :3].max(axis=(0, 1)))
                        | {"area": float(areas[index])} for index in faces)
        _known[asset] = _Facts(materials=shown, smooth=_is_smooth(asset), figures=figures)
    return _known[asset]


def _figures(material: Material, vertices: tuple[float, float] | None,
             brightest: Sequence[float] | np.ndarray) -> dict[str, Any]:
    """vertices: least and largest alpha of its coloured vertices, if it has any. brightest: largest red, green and blue
    of all of its vertices."""
    smoothest, roughest = range_of(material, "roughness")
    return {"scattered": scattered_share(material, brightest), "smoothest": smoothest, "roughest": roughest,
            "coverage": coverage_range(material, vertices or (1.0, 1.0)), "coloured": vertices is not None}


def _is_smooth(asset: Asset) -> bool:
    """Whether any two faces that share their normals lie in different planes; see `geometry.edges`."""
    edges = edges_of(asset.mesh.faces)
    angle = dihedral_angles(asset.mesh, edges)
    return bool(((angle > FLAT) & (angle <= CREASE_ANGLE) & consistent(edges)).any())


def scene_use(room: RoomPlan, objects: Iterable[PlacedObject], mesh_root: Path) -> SceneUse:
    """What a room and the objects in it show. Raises PlanError where a file is not the one that was planned, UserError
    where it cannot be read."""
    around, objects = room_parts(room, mesh_root), tuple(objects)
    placed = [(each.object.name, "furniture", asset_of(each.object, mesh_root), 1.0) for each in objects]
    things = [*((part.name, str(part.part), part.asset, _growth(part.world)) for part in around), *placed]
    uses = [MaterialUse(owner=owner, part=part, material=material, **figures | {"area": figures["area"] * growth})
            for owner, part, asset, growth in things
            for material, figures in zip(_facts(asset).materials, _facts(asset).figures, strict=True)]
    bodies = [*((part.name, part.asset, part.world) for part in around),
              *((each.object.name, asset_of(each.object, mesh_root), world_from_object(each)) for each in objects)]
    smooth = dict.fromkeys(owner for owner, _, asset, _ in things if _facts(asset).smooth)
    flat = dict.fromkeys(owner for owner, *_ in things if owner not in smooth)
    return SceneUse(materials=tuple(uses), smooth=tuple(smooth), flat=tuple(flat),
                    files=tuple((word, f"{owner}: {said}") for owner, _, asset, _ in placed
                                for word, said in told_of(asset)),
                    scene=told_of_scene(room, mesh_root), unowned=unowned_glass(bodies))


def _growth(world: np.ndarray) -> float:
    """What areas are multiplied by in the world; exact but for uneven stretches."""
    return float(abs(np.linalg.det(world[:3, :3])) ** (2 / 3))


def told_of_scene(room: RoomPlan, mesh_root: Path) -> tuple[tuple[str, str], ...]:
    """Of a scene from a file, pairs of a word and a sentence: one of each word, however many things it is about."""
    if room.kind == "procedural":
        return ()
    model, around = scene_model(room, mesh_root), room_parts(room, mesh_root)
    told = {"contains": model.contains, "left out": _listed(model.left_out), "faults": _listed(model.faults)}
    for key, word in TOLD.items():
        said = [f"{part.name}: {part.asset.meta[key]}" for part in around if part.asset.meta.get(key)]
        if key != "contains" and said:
            about = f"{len(said)} of {len(around)} things: {_listed(said, THINGS)}"
            told[word] = "; ".join(filter(None, [told.get(word, ""), about]))
    told["taken away"] = _listed(room.scene.hidden)
    return tuple((word, said) for word, said in told.items() if said)


def _listed(sentences: Sequence[str], most: int = SENTENCES) -> str:
    """The first few sentences, and how many more there are."""
    more = len(sentences) - most
    return "; ".join(sentences[:most]) + (f"; and {more} more" if more > 0 else "")
