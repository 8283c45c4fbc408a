"""Pictures of an arrangement, drawn off screen: from above, near walls and roof cut away, and through the camera."""

from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.report.looking.light_shapes import COLOURS, LightShape
from dataset_builder.report.looking.off_screen import plotter
from dataset_builder.report.looking.plain_numbers import metres
from dataset_builder.report.looking.shown_arrangement import BELOW_ROOF, ShownArrangement
from dataset_builder.report.looking.standing import StandingThing

if TYPE_CHECKING:
    from pyvista import PolyData

CAMERA_COLOUR, TARGET_COLOUR = (190, 30, 45), (0, 120, 90)
PANE = 0.25
"""Opacity of what lets light through."""
INK, HALO, FONT = (25, 25, 25), (255, 255, 255), 15
MOST_LETTERS = 40
"""Of a name; what is longer would cover the picture."""
MOST_NAMES = 12
"""Pieces of furniture that are named, the nearest to the target first."""


def above(shown: ShownArrangement, width: int, height: int) -> np.ndarray:
    """(height, width, 3) uint8: the arrangement from above, with names and distances."""
    eye = shown.eye(width, height)
    return _named(_drawn(shown, eye, cut=True), shown, eye)


def through_camera(shown: ShownArrangement, width: int) -> np.ndarray | None:
    """(H, width, 3) uint8: what the camera sees, in colours without light; None where there is no camera."""
    if shown.camera is None:
        return None
    camera = shown.camera
    height = max(1, round(width * camera.height / camera.width))
    return _drawn(shown, Pinhole(position=camera.position, target=camera.target, up=camera.up, fov=camera.fov,
                                 width=width, height=height), cut=False)


def frustum(camera: Pinhole, centre: np.ndarray) -> np.ndarray:
    """(8, 2, 3) lines from the camera to the corners of its picture as far ahead as `centre` (3,), and around it."""
    distance = float(np.dot(centre - camera.position, camera.basis[2]))
    columns, rows = np.array([0, camera.width, camera.width, 0]), np.array([0, 0, camera.height, camera.height])
    corners = camera.position + distance * camera.directions(columns, rows)
    return np.concatenate([np.stack([np.broadcast_to(camera.position, (4, 3)), corners], axis=1),
                           np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)])


def _drawn(shown: ShownArrangement, eye: Pinhole, *, cut: bool) -> np.ndarray:
    made = plotter(eye.width, eye.height)
    try:
        for part in (False, True):
            for mesh in _meshes(shown, eye, clear=part, cut=cut):
                made.add_mesh(mesh, scalars="colour", rgb=True, opacity=PANE if part else 1.0, ambient=0.25,
                              diffuse=0.8, specular=0.0, show_scalar_bar=False)
        for light in shown.lights:
            if cut or light.of == "target":
                _add_light(made, light, lines=cut)
        _aim(made, eye)
        pixels = np.asarray(made.screenshot(return_img=True))
    finally:
        made.close()
    return np.ascontiguousarray(pixels[..., :3])


def _aim(made: Any, eye: Pinhole) -> None:
    """Put the viewer where a pinhole camera is."""
    camera = made.camera
    camera.position, camera.focal_point, camera.up = (tuple(each) for each in (eye.position, eye.target, eye.up))
    # VTK's angle is the vertical one
    camera.view_angle = float(np.degrees(2 * np.arctan(np.tan(np.radians(eye.fov) / 2) * eye.aspect)))
    made.renderer.ResetCameraClippingRange()


def _meshes(shown: ShownArrangement, eye: Pinhole, *, clear: bool, cut: bool) -> list["PolyData"]:
    """What is opaque or clear: the building's walls, and all else, each as one mesh, cut as asked."""
    found = []
    for walls in (True, False):
        mesh = _joined([thing for thing in shown.things if (thing.part == "walls") == walls], clear)
        if cut and mesh.n_cells:
            if np.isfinite(shown.roof):
                mesh = mesh.clip(normal="z", origin=(0, 0, shown.roof - BELOW_ROOF))
            if walls and mesh.n_cells:
                mesh = mesh.clip(normal=(*(eye.position - shown.centre)[:2], 0), origin=shown.centre)
        found += [mesh] if mesh.n_cells else []
    return found


def _joined(things: list[StandingThing], clear: bool) -> "PolyData":
    """Faces of things as one mesh with a colour each."""
    from pyvista import PolyData

    kept = [(thing, thing.clear == clear) for thing in things]
    starts = np.cumsum([0, *(len(thing.positions) for thing, _ in kept)])
    faces = [thing.faces[own] + start for (thing, own), start in zip(kept, starts, strict=False)]
    if not sum(map(len, faces)):
        return PolyData()
    mesh: PolyData = PolyData.from_regular_faces(np.concatenate([thing.positions for thing, _ in kept]),
                                                 np.concatenate(faces))
    mesh.cell_data["colour"] = np.concatenate([thing.colours[own] for thing, own in kept])
    return mesh


def _add_light(made: Any, light: LightShape, *, lines: bool) -> None:
    from pyvista import PolyData

    if len(light.faces):
        made.add_mesh(PolyData.from_regular_faces(light.positions, light.faces), color=COLOURS[light.of],
                      lighting=False)
    if lines and len(light.lines):
        made.add_lines(light.lines.reshape(-1, 3), color=COLOURS[light.of], width=1.5)


def box_edges(box: np.ndarray) -> np.ndarray:
    """(12, 2, 3) of a box of two corners."""
    corners = np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    return np.array([[corners[a], corners[a | bit]] for a in range(8) for bit in (1, 2, 4) if not a & bit])


def camera_name(camera: Pinhole, shown: ShownArrangement) -> str:
    """`camera, 1.54 m`: with its distance from the target."""
    return f"camera, {metres(float(np.linalg.norm(camera.position - shown.centre)))} m"


def light_name(light: LightShape, shown: ShownArrangement) -> str:
    """`target 0: spot, 2.03 m`: with its distance from the target, unless it shines from outside."""
    away = float(np.linalg.norm(light.at - shown.centre))
    return light.name if light.outside else f"{light.name}, {metres(away)} m"


def names(shown: ShownArrangement) -> list[tuple[str, np.ndarray, tuple[int, int, int]]]:
    """What is named, with the place (3,) that it is named at and its colour, the most important first."""
    found = [(shown.target.name, np.append(shown.centre[:2], shown.target.box[1, 2]), TARGET_COLOUR)]
    if shown.camera is not None:
        found.append((camera_name(shown.camera, shown), shown.camera.position, CAMERA_COLOUR))
    found += [(light_name(light, shown), light.at, COLOURS[light.of]) for light in shown.lights]
    pieces = [thing for thing in shown.things if thing.part == "furniture"]
    pieces.sort(key=lambda thing: float(np.linalg.norm(thing.box.mean(axis=0) - shown.centre)))
    return found + [(thing.category, np.append(thing.box[:, :2].mean(axis=0), thing.box[1, 2]), INK)
                    for thing in pieces[:MOST_NAMES]]


def _named(pixels: np.ndarray, shown: ShownArrangement, eye: Pinhole) -> np.ndarray:
    """The picture with the camera's view, the target's box, and names where there is room; the first come first."""
    image = Image.fromarray(pixels)
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(FONT)
    # On top of all, since much of a frustum is below the floor
    overlaid = [(box_edges(shown.target.box), TARGET_COLOUR)]
    overlaid += [(frustum(shown.camera, shown.centre), CAMERA_COLOUR)] if shown.camera else []
    for lines, colour in overlaid:
        for line in lines:
            ends = eye.project(line)
            if (ends[:, 2] > 0).all():
                draw.line([tuple(end) for end in ends[:, :2]], fill=colour, width=2)
    taken: list[tuple[float, ...]] = []
    for name, at, colour in names(shown):
        text = name if len(name) <= MOST_LETTERS else name[:MOST_LETTERS - 1] + "…"
        column, row, ahead = eye.project(at[None])[0]
        if ahead <= 0 or not (0 <= column < eye.width and 0 <= row < eye.height):
            continue
        for drop in range(0, 5 * FONT, FONT // 2):
            box = draw.textbbox((column, row - FONT + drop), text, font=font, anchor="mm")
            if box[3] < eye.height and all(_apart(box, other) for other in taken):
                taken.append(box)
                draw.text((column, row - FONT + drop), text, fill=colour, font=font, anchor="mm", stroke_width=2,
                          stroke_fill=HALO)
                break
    return np.asarray(image)


def _apart(one: tuple[float, ...], other: tuple[float, ...]) -> bool:
    return one[2] < other[0] or other[2] < one[0] or one[3] < other[1] or other[3] < one[1]
