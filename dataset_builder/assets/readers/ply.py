"""PLY: text and binary of either byte order, polygons, colours, textures.

G. Turk, "The PLY Polygon File Format", 1994; textures and their coordinates as MeshLab and Blender write them.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dataset_builder.assets.asset import Material
from dataset_builder.assets.file_model import ROUGHNESS, FileMaterial, FileModel, FilePart, refuse
from dataset_builder.assets.image_maps import ImageFile, make_texture, read_texels
from dataset_builder.assets.linear_texels import linear_rgba
from dataset_builder.assets.readers.color_scale import as_shares
from dataset_builder.assets.readers.ply_tables import Lists, Table, ply_tables
from dataset_builder.assets.readers.polygon_checks import checked_triangles, content_of, crossing, polygon_counts
from dataset_builder.spec.file_reference import is_inside
from dataset_builder.spec.mesh_source import MADE_OF_SPLATS
from dataset_builder.spec.ply_references import PlyHeader, ply_header

POSITION = ("x", "y", "z")
NORMAL = ("nx", "ny", "nz")
COLOR = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
ALPHA = ("alpha", "diffuse_alpha", "a")
UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
CORNERS = ("vertex_indices", "vertex_index")
SPLAT = {"f_dc_0", "scale_0", "rot_0"}


@dataclass(frozen=True, kw_only=True, eq=False)
class _Faces:
    indices: np.ndarray
    """(C,) int64 corners of all faces."""
    counts: np.ndarray
    """(F,) corners of each."""
    columns: Table
    """What else the file says of its faces."""


def read(path: Path, max_texture: int) -> FileModel:
    """The whole file. Raises UserError where it breaks the format, is cut short, or has no faces."""
    data = content_of(path)
    try:
        header = ply_header(data)
    except ValueError as error:
        refuse(path, f"expected a PLY file, got: {error}")
    tables = ply_tables(path, data, header)
    vertex = tables.get("vertex", {})
    columns = [column for name in POSITION if isinstance(column := vertex.get(name), np.ndarray)]
    if len(columns) < 3:
        refuse(path, f"expected an element vertex with x, y and z, got {', '.join(vertex) or 'none'}")
    positions = np.stack(columns, axis=1).astype(np.float64)
    faces = _faces(path, tables, len(positions))
    found = checked_triangles(path, positions, faces.indices, faces.counts)
    uvs, numbers = _texturing(path, header, vertex, faces)
    colors, doubts = _corner_colors(path, vertex, faces)
    used = sorted({*np.unique(numbers).tolist()} - {-1})
    lost = ["colours under a texture"] if colors is not None and used else []
    lost += [f"texture {name}, which no face uses" for number, (_, name) in enumerate(header.textures)
             if number not in used]
    parts = []
    for number in np.unique(numbers[found.owner]).tolist():
        corners = found.corners[numbers[found.owner] == number]
        parts.append(FilePart(name=header.textures[number][1] if number >= 0 else "faces", positions=positions,
                              faces=faces.indices[corners], material=used.index(number) if number >= 0 else -1,
                              uvs={} if uvs is None else {0: uvs[corners]},
                              colors=None if colors is None or number >= 0 else colors[corners]))
    doubts = doubts if any(part.colors is not None for part in parts) else []
    return FileModel(parts=tuple(parts), contains=polygon_counts(len(positions), len(faces.counts), found),
                     left_out=(*lost, *_others(tables), *doubts, *crossing(found)),
                     materials=tuple(_material(path, header.textures[number][1], max_texture) for number in used))


def _faces(path: Path, tables: dict[str, Table], vertices: int) -> _Faces:
    face = tables.get("face", {})
    lists = next((value for name in CORNERS if isinstance(value := face.get(name), Lists)), None)
    if lists is not None and len(lists.counts):
        others = {name: column for name, column in face.items() if column is not lists}
        return _Faces(indices=_whole(path, lists.values), counts=lists.counts, columns=others)
    strips = tables.get("tristrips", {}).get(CORNERS[0])
    if isinstance(strips, Lists) and len(strips.values):
        corners = _strip_corners(_whole(path, strips.values), strips.counts)
        return _Faces(indices=corners.reshape(-1), counts=np.full(len(corners), 3), columns={})
    if set(tables["vertex"]) >= SPLAT:
        refuse(path, f"expected faces, got a cloud of {vertices} Gaussian splats", MADE_OF_SPLATS)
    if face and lists is None:
        refuse(path, f"expected faces with a list {CORNERS[0]}, got {', '.join(face)}")
    refuse(path, f"expected faces, got none: a cloud of {vertices} points", "reconstruct a surface of it")


def _whole(path: Path, values: np.ndarray) -> np.ndarray:
    """Indices as int64; those that are too large become negative."""
    if values.dtype.kind == "f":
        refuse(path, "expected a list of integers as the corners of faces, got one of floating-point numbers")
    return values.astype(np.int64)


def _strip_corners(values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """(T, 3) corners of triangle strips; -1 begins another, every second triangle of one is turned round."""
    starts = np.zeros(len(values), dtype=bool)
    starts[(np.cumsum(counts) - counts)[counts > 0]] = True
    starts[1:] |= values[:-1] < 0
    place = np.arange(len(values))
    within = place - np.maximum.accumulate(np.where(starts, place, 0))
    last = np.flatnonzero((within >= 2) & (values >= 0))
    corners = np.stack([values[last - 2], values[last - 1], values[last]], axis=1)
    odd = within[last] % 2 == 1
    corners[odd] = corners[odd][:, [1, 0, 2]]
    return corners


# Colours

def _corner_colors(path: Path, vertex: Table, faces: _Faces) -> tuple[np.ndarray | None, list[str]]:
    """(C, 4) linear colours of all corners, those of vertices before those of faces, and what is doubtful."""
    if (colors := _colors(path, vertex)) is not None:
        rgba, doubts = colors
        both = ["colours of faces beside those of vertices, not taken"] if _channels(faces.columns) else []
        return rgba[faces.indices], [*doubts, *both]
    if (colors := _colors(path, faces.columns)) is not None:
        rgba, doubts = colors
        return np.repeat(rgba, faces.counts, axis=0), doubts
    return None, []


def _channels(table: Table) -> list[np.ndarray]:
    """Columns of red, green, blue and, where there is one, alpha."""
    for names in COLOR:
        found = [column for name in names if isinstance(column := table.get(name), np.ndarray)]
        if len(found) == 3:
            alpha = [column for name in ALPHA if isinstance(column := table.get(name), np.ndarray)]
            return found + alpha[:1]
    return []


def _colors(path: Path, table: Table) -> tuple[np.ndarray, list[str]] | None:
    """(N, 4) linear colours and coverage of a table's rows, and what is doubtful about them."""
    channels = _channels(table)
    if not channels:
        return None
    if bad := sum(int((~np.isfinite(channel)).sum()) for channel in channels):
        refuse(path, f"expected colours, got {bad} NaN or Inf among them")
    decimal = [number for number, channel in enumerate(channels) if channel.dtype.kind == "f"]
    shares = np.stack([channel if number in decimal else np.clip(channel / np.iinfo(channel.dtype).max, 0, 1)
                       for number, channel in enumerate(channels)], axis=1)
    shares[:, decimal], doubts = as_shares(shares[:, decimal])
    return linear_rgba(shares), ["colours taken as sRGB", *doubts]


# Textures

def _texturing(path: Path, header: PlyHeader, vertex: Table,
               faces: _Faces) -> tuple[np.ndarray | None, np.ndarray]:
    """(C, 2) texture coordinates of all corners, and (F,) number of each face's texture, or -1."""
    numbers = np.full(len(faces.counts), -1)
    uvs, has = _coordinates(path, vertex, faces)
    if uvs is None or not header.textures:
        return uvs, numbers
    stated = faces.columns.get("texnumber")
    if isinstance(stated, np.ndarray):
        numbers = stated.astype(np.int64)
        wrong = np.flatnonzero((numbers < -1) | (numbers >= len(header.textures)))
        if len(wrong):
            refuse(path, f"expected texnumber in [-1, {len(header.textures)}), got {len(wrong)} faces with others, "
                         f"first at face {wrong[0]}, which has {numbers[wrong[0]]}")
    else:
        numbers[:] = 0
    return uvs, np.where(has, numbers, -1)


def _coordinates(path: Path, vertex: Table, faces: _Faces) -> tuple[np.ndarray | None, np.ndarray]:
    """(C, 2) texture coordinates of all corners, and (F,) which faces have them; those of faces before those of
    vertices."""
    every = np.ones(len(faces.counts), dtype=bool)
    uvs: np.ndarray | None = None
    if isinstance(lists := faces.columns.get("texcoord"), Lists):
        every = lists.counts > 0
        wrong = np.flatnonzero(every & (lists.counts != 2 * faces.counts))
        if len(wrong):
            refuse(path, f"expected two texture coordinates for each corner, got {len(wrong)} faces with others, first "
                         f"at face {wrong[0]}, which has {lists.counts[wrong[0]]} for {faces.counts[wrong[0]]} corners")
        uvs = np.zeros((len(faces.indices), 2))
        uvs[np.repeat(every, faces.counts)] = lists.values.reshape(-1, 2)
    else:
        for names in UV:
            pair = [column for name in names if isinstance(column := vertex.get(name), np.ndarray)]
            if len(pair) == 2:
                uvs = np.stack(pair, axis=1).astype(np.float64)[faces.indices]
                break
    if uvs is not None and not np.isfinite(uvs).all():
        refuse(path, f"expected texture coordinates, got {int((~np.isfinite(uvs)).sum())} NaN or Inf among them")
    return uvs, every


def _material(path: Path, name: str, max_texture: int) -> FileMaterial:
    """White under the texture of that name; what of it is see-through is not there."""
    if not is_inside(path.parent, name):
        refuse(path, f"expected textures in the folder of the mesh or below it, got {name}")
    texels = read_texels(ImageFile(name=str(path.parent / name), content=path.parent / name), srgb=True,
                         max_size=max_texture)
    maps = {"base_color": texels[..., :3], **({"alpha": texels[..., 3]} if texels[..., 3].min() < 1 else {})}
    return FileMaterial(material=Material(name=name, base_color=(1.0, 1.0, 1.0), roughness=ROUGHNESS,
                                          texture=make_texture(maps)))


# What is not taken

def _others(tables: dict[str, Table]) -> list[str]:
    """Elements and properties that mean nothing here; normals are worked out from the faces."""
    vertex = {*POSITION, *NORMAL, *ALPHA, *(name for names in (*COLOR, *UV) for name in names)}
    face = {*NORMAL, *CORNERS, *ALPHA, *(name for names in COLOR for name in names), "texcoord", "texnumber"}
    known = {"vertex": vertex, "face": face, "tristrips": {CORNERS[0]}}
    lost = []
    for name, table in tables.items():
        if name not in known:
            lost.append(f"element {name}")
        elif others := [column for column in table if column not in known[name]]:
            lost.append(f"{name} properties {', '.join(others)}")
    return lost
