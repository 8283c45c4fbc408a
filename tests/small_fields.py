"""Fields made in code, for tests that need the file of one: a ball that stands on the floor, and a room."""

from pathlib import Path

import numpy as np

from dataset_builder.assets.field_file import FieldFile, write_field
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.label.field_record import FieldRecord

RECORD = FieldRecord(key="k", kind="density", truth=False, views=40, held_out=8, width=64, resolution=16, psnr=31.0,
                     psnr_worst=27.5, ssim=0.9, opacity_iou=0.95, silhouette_iou=0.96, level=0.1, bodies=1,
                     bodies_dropped=2, depth_95=0.0, loss=0.01)


def ball(radius: float = 0.4, rings: int = 12) -> TriangleMesh:
    """A closed ball that touches z = 0 over the origin, coloured by place."""
    heights = np.linspace(0, np.pi, rings + 1)[1:-1]
    around = np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False)
    ring = np.stack([np.cos(around), np.sin(around)], axis=1)
    points = [[0, 0, 1], *(np.r_[np.sin(h) * xy, np.cos(h)] for h in heights for xy in ring), [0, 0, -1]]
    n, last = len(around), 1 + len(around) * len(heights)
    faces = [(0, 1 + k, 1 + (k + 1) % n) for k in range(n)]
    for row in range(len(heights) - 1):
        upper, lower = 1 + row * n, 1 + (row + 1) * n
        faces += [face for k in range(n) for face in ((upper + k, lower + k, lower + (k + 1) % n),
                                                      (upper + k, lower + (k + 1) % n, upper + (k + 1) % n))]
    faces += [(last - n + k, last, last - n + (k + 1) % n) for k in range(n)]
    return coloured(radius * (np.array(points) + np.array([0, 0, 1])), np.array(faces))


def coloured(positions: np.ndarray, faces: np.ndarray) -> TriangleMesh:
    """A mesh whose colours are where its vertices lie in its box."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    shares = 0.2 + 0.6 * (positions - low) / (high - low)
    colors = np.concatenate([shares, np.ones((len(positions), 1))], axis=1)
    return TriangleMesh(positions=positions, faces=faces, uvs=np.zeros((len(faces), 3, 2)),
                        material=np.zeros(len(faces), np.int64), colors=colors[faces])


def room(size: tuple[float, float, float] = (4.0, 3.5, 2.5), cells: int = 4) -> TriangleMesh:
    """The inside of a box on z = 0 with a square table top of 1 m at 0.7 m: what a capture of a room looks like."""
    steps = np.linspace(-0.5, 0.5, cells + 1)
    grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), axis=-1).reshape(-1, 2)
    square = np.array([(row * (cells + 1) + k, (row + 1) * (cells + 1) + k, (row + 1) * (cells + 1) + k + 1,
                        row * (cells + 1) + k + 1) for row in range(cells) for k in range(cells)])
    faces = np.concatenate([square[:, [0, 1, 2]], square[:, [0, 2, 3]]])
    points, corners = [], []
    for axis in range(3):
        for side in (-0.5, 0.5):
            sheet = np.insert(grid, axis, side, axis=1)
            normal = np.cross(sheet[faces[0, 1]] - sheet[faces[0, 0]], sheet[faces[0, 2]] - sheet[faces[0, 0]])
            corners.append((faces if normal[axis] * side < 0 else faces[:, ::-1]) + len(points) * len(grid))
            points.append(sheet * size + [0, 0, size[2] / 2])
    corners.append(faces + len(points) * len(grid))
    points.append(np.insert(grid, 2, 0.7, axis=1))
    return coloured(np.concatenate(points), np.concatenate(corners))


def ball_field(radius: float = 0.4, cells: int = 32) -> FieldFile:
    """A field of a solid ball that stands on z = 0: red towards +X, blue towards -X, 0.5 of green."""
    steps = (np.arange(cells) + 0.5) / cells * 2 - 1
    z, y, x = np.meshgrid(steps, steps, steps, indexing="ij")
    within = np.sqrt(x**2 + y**2 + z**2) < 0.8
    share = np.clip(0.5 + 0.5 * x / 0.8, 0.05, 0.95)
    colours = np.stack([share, np.full_like(share, 0.5), 1 - share], axis=-1)
    # Radiance is softplus(4 v) / 4, optical depth of a cell softplus(3 v - 12)
    grid = np.concatenate([np.where(within, 12.0, 0.0)[..., None], np.log(np.expm1(4 * colours)) / 4], axis=-1)
    return FieldFile(record=RECORD, mesh=ball(radius), centre=(0.0, 0.0, radius), radius=radius / 0.8,
                     grid=grid.astype(np.float32), numbers={"scale": 1.0})


def field_of(mesh: TriangleMesh) -> FieldFile:
    """A field without cells: its mesh and its figures."""
    low, high = mesh.bounds
    middle = tuple(((low + high) / 2).tolist())
    return FieldFile(record=RECORD, mesh=mesh, centre=middle, radius=float(np.linalg.norm(high - low) / 2))


def write_ball(path: Path, *, radius: float = 0.4, moved: tuple[float, float, float] = (0, 0, 0)) -> Path:
    """The file of a ball's field."""
    mesh = ball(radius)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_field(path, field_of(coloured(mesh.positions + moved, mesh.faces)))
    return path
