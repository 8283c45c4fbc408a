"""Pictures of an arrangement: cameras are the pinhole's, and nothing hides what is looked at."""

from base64 import b64decode
from dataclasses import replace
from zlib import decompress

import numpy as np
import pytest

from dataset_builder.geometry.pinhole import Pinhole
from dataset_builder.report.looking.arrangement_data import STEPS, arrangement_data
from dataset_builder.report.looking.arrangement_picture import TARGET_COLOUR, above, through_camera
from dataset_builder.report.looking.shown_arrangement import ShownArrangement
from dataset_builder.report.looking.standing import StandingThing, roof_above

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
                  [0, 6, 4], [1, 5, 7], [1, 7, 3]])
RED, GREY = (200, 20, 20), (128, 128, 128)


def block(name: str, part: str, low: tuple[float, ...], high: tuple[float, ...],
          colour: tuple[int, int, int] = GREY) -> StandingThing:
    """A box of one colour."""
    positions = np.array(low) + CORNERS * np.subtract(high, low)
    return StandingThing(name=name, part=part, category="box", positions=positions, faces=FACES,
                         colours=np.tile(np.array(colour, np.uint8), (12, 1)), clear=np.zeros(12, bool))


TARGET = block("target", "target", (-0.3, -0.2, 0), (0.5, 0.4, 0.7), RED)
ROOM = (block("floor", "floor", (-2, -2, -0.1), (2, 2, 0)), block("ceiling", "ceiling", (-2, -2, 1.3), (2, 2, 1.4)),
        *(block(f"wall {k}", "walls", *ends) for k, ends in enumerate((
            ((-2.1, -2, 0), (-2, 2, 1.3)), ((2, -2, 0), (2.1, 2, 1.3)), ((-2, -2.1, 0), (2, -2, 1.3)),
            ((-2, 2, 0), (2, 2.1, 1.3))))))
CAMERA = Pinhole(position=np.array([1.6, -1.5, 1.1]), target=np.array([0.1, 0.2, 0.3]), up=np.array([0.2, 0.1, 0.97]),
                 fov=50, width=96, height=64)
ALONE = ShownArrangement(things=(TARGET,), lights=(), camera=CAMERA, roof=np.inf)


def reddish(pixels: np.ndarray) -> np.ndarray:
    """(H, W) where the target is."""
    return pixels[..., 0].astype(int) > 2 * pixels[..., 1].astype(int) + 10


@pytest.mark.parametrize("size", [(96, 64), (64, 96)])
def test_the_camera_sees_the_target_where_the_pinhole_says(size: tuple[int, int]) -> None:
    camera = replace(CAMERA, width=size[0], height=size[1])
    seen = through_camera(replace(ALONE, camera=camera), 4 * size[0])
    assert seen is not None
    assert seen.shape == (4 * size[1], 4 * size[0], 3)
    rows, columns = np.nonzero(reddish(seen))
    expected = 4 * camera.project(TARGET.positions)[:, :2]
    limits = np.clip(expected, 0, [4 * size[0], 4 * size[1]])
    np.testing.assert_allclose([columns.min(), rows.min()], limits.min(axis=0), atol=1.5)
    np.testing.assert_allclose([columns.max() + 1, rows.max() + 1], limits.max(axis=0), atol=1.5)


def test_a_room_is_cut_open_towards_the_viewer() -> None:
    roof = roof_above((TARGET, *ROOM), np.vstack([TARGET.box.mean(axis=0), CAMERA.position]))
    assert roof == pytest.approx(1.3)
    tall = [replace(each, positions=each.positions * (1, 1, 4)) for each in ROOM if each.part == "walls"]
    room = replace(ALONE, things=(TARGET, *ROOM), camera=None, roof=roof)
    seen, under_ceiling, walled, behind_walls = (reddish(above(each, 240, 180)).sum() for each in (
        room, replace(room, roof=np.inf), replace(room, things=(TARGET, *tall), roof=np.inf),
        replace(room, things=(TARGET, *(replace(each, part="furniture") for each in tall)), roof=np.inf)))
    assert seen > 300
    assert under_ceiling < 20
    assert walled > 100
    assert behind_walls < 20


def test_names_are_written_beside_what_they_name() -> None:
    named, plain = above(ALONE, 320, 240), above(replace(ALONE, things=(replace(TARGET, name=" "),)), 320, 240)
    row, column = (axis.mean() for axis in np.nonzero((named != plain).any(axis=2)))
    middle, = ALONE.eye(320, 240).project(np.array([[0.1, 0.1, 0.7]]))
    assert abs(column - middle[0]) < 4
    assert abs(row - middle[1]) < 40
    near = np.abs(named.astype(int) - TARGET_COLOUR).max(axis=2) < 40
    assert near.sum() > 50


def test_the_viewer_sees_all_of_a_room() -> None:
    shown = replace(ALONE, things=(TARGET, *ROOM))
    for width, height in ((320, 240), (240, 320)):
        column, row, ahead = shown.eye(width, height).project(
            np.array(np.meshgrid(*shown.bounds.T)).reshape(3, -1).T).T
        assert (ahead > 0).all()
        assert ((column > 0) & (column < width) & (row > 0) & (row < height)).all()
        assert max(np.ptp(column) / width, np.ptp(row) / height) > 0.6


def test_a_page_has_every_triangle_where_it_is() -> None:
    data = arrangement_data(replace(ALONE, things=(TARGET, *ROOM)))
    assert data["roof"] is None
    for thing, sent in zip((TARGET, *ROOM), data["things"], strict=True):
        read = decompress(b64decode(sent["data"]))
        count, vertices = sent["triangles"], sent["vertices"]
        assert len(read) == 12 * count + 6 * vertices + 4 * count
        np.testing.assert_array_equal(np.frombuffer(read, "<u4", 3 * count).reshape(-1, 3), thing.faces)
        steps = np.frombuffer(read, "<u2", 3 * vertices, 12 * count).reshape(-1, 3)
        found = np.array(sent["low"]) + steps / STEPS * np.array(sent["side"])
        np.testing.assert_allclose(found, thing.positions, atol=1e-5 + 4 / STEPS)
        colours = np.frombuffer(read, np.uint8, 3 * count, 12 * count + 6 * vertices)
        np.testing.assert_array_equal(colours.reshape(-1, 3), thing.colours)
