"""Images of lights are looked at before anything is rendered."""

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from dataset_builder.cli.main import main
from dataset_builder.errors import PlanError
from dataset_builder.rendering.scene.image_check import check_images
from dataset_builder.spec.load import load_dataset
from tests.small_specs import FILES, run_build, write_spec

LIGHTS = "source: {environment: sky.exr}\ntarget: {textures: [good.exr, bad.exr]}\n"


def spec(folder, **pictures):
    for name, pixels in pictures.items():
        OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": np.ascontiguousarray(pixels, dtype=np.float32)}).write(
            str(folder / f"{name}.exr"))
    return write_spec(folder, {"small.yaml": FILES["small.yaml"] + LIGHTS})


def test_every_image_is_named_with_its_line(tmp_path, capsys):
    even, nan = np.ones((8, 16, 3)), np.ones((8, 16, 3))
    nan[2, 3] = np.nan
    path = spec(tmp_path, sky=np.zeros((8, 16, 3)), good=even, bad=nan)
    line = len(FILES["small.yaml"].splitlines()) + 1
    with pytest.raises(PlanError) as caught:
        check_images(load_dataset(path))
    assert [str(problem) for problem in caught.value.problems] == [
        f"{path}:{line}: source.environment: sky.exr: expected an image with a value above 0, got a black one "
        "(leave it out, or correct it)",
        f"{path}:{line + 1}: target.textures[1]: bad.exr: expected finite values of at least 0, got nan in 3 places "
        "(mend it)"]
    assert main(["plan", str(path)]) == 2
    assert "target.textures[1]: bad.exr" in capsys.readouterr().err
    with pytest.raises(PlanError, match=r"sky\.exr: expected an image with"):
        run_build(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_environment_is_twice_as_wide_as_high(tmp_path):
    even = np.ones((8, 16, 3))
    check_images(load_dataset(spec(tmp_path, sky=even, good=even, bad=np.ones((16, 8, 3)))))
    with pytest.raises(PlanError, match=r"expected latitude and longitude, twice as wide as high, got 16 x 16"):
        check_images(load_dataset(spec(tmp_path, sky=np.ones((16, 16, 3)), good=even, bad=even)))


def test_a_texture_of_a_room_is_looked_at_too(tmp_path):
    (tmp_path / "a.png").write_bytes(b"no picture")
    path = write_spec(tmp_path, {"rooms/den.yaml": "width: 4\nmaterials:\n  wall: {texture: ../a.png}\n"})
    with pytest.raises(PlanError) as caught:
        check_images(load_dataset(path))
    assert str(caught.value).startswith(f"{tmp_path / 'rooms/den.yaml'}:3: materials.wall.texture: a.png: expected a "
                                        "readable image")


def test_walls_let_no_light_through(tmp_path):
    path = write_spec(tmp_path, {"rooms/den.yaml": "width: 4\nmaterials:\n  wall: {texture: ../a.png}\n"})
    for alpha, refused in ((255, False), (254, True)):
        image = Image.new("RGBA", (4, 4), (200, 100, 50, 255))
        image.putpixel((1, 2), (200, 100, 50, alpha))
        image.save(tmp_path / "a.png")
        if not refused:
            check_images(load_dataset(path))
            continue
        with pytest.raises(PlanError, match=r"materials\.wall\.texture: a\.png: expected an image that is opaque, got"):
            check_images(load_dataset(path))
