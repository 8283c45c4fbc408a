"""A folder of photographs to an object: options, files, and what goes into the fit and comes out of it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dataset_builder.assets.field_file import FieldFile, read_field
from dataset_builder.cli.main import main
from dataset_builder.errors import UserError
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.geometry.posed_images import PosedImages
from dataset_builder.importing.capture_import import CaptureJob, ImportedCapture, import_capture
from dataset_builder.importing.captures.photographs import Ball
from dataset_builder.spec.load import load_dataset
from tests.assets.test_field_file import RECORD
from tests.capture_files import BOX, HEIGHT, Made, orbit, tilted

MADE = Made(poses=orbit(16), size=(48, 48), focal=72.0, turn=tilted(), scale=3.0)


class Stub:
    """A fit that gives the box itself, and remembers what it got."""

    def __init__(self) -> None:
        self.calls = list[dict[str, object]]()

    def __call__(self, images: PosedImages, held_out: PosedImages, job: CaptureJob, *, ball: Ball, white: float,
                 key: str, checkpoint: Path) -> FieldFile:
        copied = replace(images, pixels=np.array(images.pixels))
        self.calls.append({"images": copied, "held": len(held_out.pixels), "ball": ball, "white": white, "key": key,
                           "checkpoint": checkpoint})
        corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.2 * ball.radius
        faces = np.array([[0, 1, 3], [4, 6, 7], [0, 4, 5], [2, 3, 7], [0, 2, 6], [1, 5, 7]])
        mesh = TriangleMesh(positions=corners + ball.centre, faces=faces, uvs=np.zeros((6, 3, 2)), material=np.zeros(6))
        return FieldFile(record=RECORD.model_copy(update={"key": key, "psnr": 21.0}), mesh=mesh, centre=ball.centre,
                         radius=ball.radius, white=white, grid=np.zeros((4, 4, 4, 4), np.float32),
                         numbers={"scale": white})


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return MADE.write_colmap(tmp_path_factory.mktemp("captures") / "thing", points=np.eye(3))


Run = Callable[..., ImportedCapture]


@pytest.fixture
def stub() -> Stub:
    return Stub()


@pytest.fixture
def run(written: Path, tmp_path: Path, stub: Stub) -> Run:
    def go(**options: object) -> ImportedCapture:
        job = CaptureJob(**{  # type: ignore[arg-type]
            "folder": written, "out": tmp_path / "out", "name": "thing", "licence": "CC0-1.0", "size": 48,
            "height": 0.75, **options})
        return import_capture(job, fit=stub, picture=None)

    return go


def test_what_goes_into_the_fit_is_upright_and_about_in_metres(run: Run, stub: Stub, tmp_path: Path) -> None:
    run()
    got = stub.calls[0]
    images, ball = got["images"], got["ball"]
    assert isinstance(images, PosedImages) and isinstance(ball, Ball)
    assert (len(images.pixels), got["held"]) == (14, 2) and got["checkpoint"] == tmp_path / "out/.thing-capture/fit"
    # Cameras stand as on the orbit, but for scale, place, and where exactly the first one sees the middle
    truth = np.delete(MADE.poses, [4, 12], axis=0)
    turn = images.poses[0, :3, :3] @ truth[0, :3, :3].T
    assert turn[2, 2] == pytest.approx(1) and abs(np.degrees(np.arctan2(turn[1, 0], turn[0, 0]))) < 2
    assert np.abs(images.poses[:, :3, :3] - turn @ truth[:, :3, :3]).max() < 1e-9
    moved = images.poses[:, :3, 3] - images.poses[0, :3, 3]
    scale = np.linalg.norm(moved[3]) / np.linalg.norm((truth[3] - truth[0])[:3, 3])
    assert np.abs(moved - scale * (truth - truth[0])[:, :3, 3] @ turn.T).max() < 1e-9 and 0.5 < scale < 1.1
    assert ball.radius == pytest.approx(0.375) and np.allclose(ball.centre, 0)
    # White: the median of what images show is taken for a reflectance of 0.18
    shown = [np.median(image[image[..., 3] == 1][:, :3] @ [0.2126, 0.7152, 0.0722]) for image in
             images.pixels.astype(float)]
    assert got["white"] == pytest.approx(np.median(shown) / 0.18, rel=0.06)


def test_what_comes_out_is_an_object(run: Run, tmp_path: Path) -> None:
    done = run(category="chair")
    assert [path.relative_to(tmp_path / "out").as_posix() for path in done.files] == ["thing.npz", "thing.yaml"]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["thing.npz", "thing.yaml"]
    content = read_field(tmp_path / "out" / "thing.npz")
    assert content.mesh.size[2] == pytest.approx(0.75) and content.mesh.bounds[0, 2] == 0
    assert not content.record.truth and content.record.masked and content.record == done.record
    assert "held-out images are shown to 21.0 dB (expected 22)" in done.notes[-1]
    text = (tmp_path / "out" / "thing.yaml").read_text()
    assert all(f"# {note}" in text for note in done.notes)
    (tmp_path / "out" / "set.yaml").write_text(
        "name: set\nimage: {width: 16, height: 16}\nsplits:\n  - name: train\n    objects: {from: [stool.yaml], "
        "count: 1}\n    scenes: {from: [scene.yaml], count: 1}\n    pairs: 1\n    views: 1\n")
    (tmp_path / "out" / "stool.yaml").write_text("family: stool\n")
    (tmp_path / "out" / "room.yaml").write_text("width: 4\n")
    (tmp_path / "out" / "scene.yaml").write_text("room: room.yaml\nfurniture:\n  - {object: thing.yaml}\n")
    spec = load_dataset(tmp_path / "out" / "set.yaml").objects["thing.yaml"]
    assert (spec.file, spec.category, spec.licence) == ("thing.npz", "chair", "CC0-1.0")


def test_a_distance_is_exact_and_no_height_is_forced(run: Run, stub: Stub) -> None:
    apart = float(np.linalg.norm(MADE.poses[0, :3, 3] - MADE.poses[4, :3, 3]))
    done = run(height=None, distance=("view_000", "view_004", apart))
    images, ball = stub.calls[0]["images"], stub.calls[0]["ball"]
    assert isinstance(images, PosedImages) and isinstance(ball, Ball)
    assert np.linalg.norm(images.poses[0, :3, 3] - images.poses[1, :3, 3]) == pytest.approx(
        np.linalg.norm(MADE.poses[0, :3, 3] - MADE.poses[1, :3, 3]))
    assert np.linalg.norm(BOX[1] - BOX[0]) / 2 < ball.radius < 0.65
    assert f"scale from {apart:g} m between view_000 and view_004" in done.notes


def test_a_rig_is_in_metres(tmp_path: Path, stub: Stub) -> None:
    replace(MADE, scale=1.0).write_actors_hq(tmp_path / "4x")
    import_capture(CaptureJob(folder=tmp_path / "4x", out=tmp_path / "out", name="a", licence="CC-BY-NC-4.0", size=48,
                              white=0.8), fit=stub, picture=None)
    assert stub.calls[0]["white"] == 0.8 and HEIGHT / 2 < stub.calls[0]["ball"].radius < 0.65  # type: ignore[attr-defined]


def test_without_a_length_it_is_refused(run: Run, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"expected a length, since the poses of COLMAP have no units \(give --height"):
        run(height=None)
    assert not (tmp_path / "out").exists()


def test_nothing_is_overwritten(run: Run, tmp_path: Path) -> None:
    run()
    before = (tmp_path / "out" / "thing.npz").read_bytes()
    with pytest.raises(UserError) as caught:
        run()
    assert [problem.where.rpartition("/")[2] for problem in caught.value.problems] == ["thing.npz", "thing.yaml"]
    assert (tmp_path / "out" / "thing.npz").read_bytes() == before


def test_all_wrong_options_are_told_at_once(run: Run) -> None:
    with pytest.raises(UserError) as caught:
        run(licence="CC BY", name="a/b", height=-1.0, white=0.0)
    assert [problem.path for problem in caught.value.problems] == ["--licence", "--name", "--height", "--white"]


def test_an_interrupted_import_goes_on(run: Run, stub: Stub, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Photographs are not read again, and the fit finds its checkpoint under the same key."""
    from dataset_builder.importing.captures import darkroom

    def struck(*arguments: object, **options: object) -> FieldFile:
        stub(*arguments, **options)  # type: ignore[arg-type]
        raise KeyboardInterrupt

    job = CaptureJob(folder=MADE.write_colmap(tmp_path / "c"), out=tmp_path / "out", name="thing", licence="CC0-1.0",
                     size=48, height=0.75)
    with pytest.raises(KeyboardInterrupt):
        import_capture(job, fit=struck, picture=None)
    assert not (tmp_path / "out" / "thing.npz").exists() and (tmp_path / "out" / ".thing-capture").is_dir()
    monkeypatch.setattr(darkroom, "photograph", lambda *arguments: pytest.fail("read again"))
    import_capture(job, fit=stub, picture=None)
    assert stub.calls[0]["key"] == stub.calls[1]["key"]
    assert not (tmp_path / "out" / ".thing-capture").exists()


def test_another_setting_is_another_field(run: Run, stub: Stub, tmp_path: Path) -> None:
    options = ({}, {"steps": 10}, {"yaw": 90.0}, {"height": 0.8}, {"white": 0.5}, {"resolution": 32})
    for number, option in enumerate(options):
        run(out=tmp_path / str(number), **option)
    assert len({call["key"] for call in stub.calls}) == len(options)


def test_without_masks_the_record_says_so(tmp_path: Path, stub: Stub) -> None:
    MADE.write_transforms(tmp_path / "a", masks=False)
    job = CaptureJob(folder=tmp_path / "a", out=tmp_path / "out", name="a", licence="CC0-1.0", size=48, height=0.75)
    done = import_capture(job, fit=stub, picture=None)
    assert not done.record.masked and "no masks: what is seen within" in (tmp_path / "out" / "a.yaml").read_text()


@pytest.mark.parametrize(("options", "rule"), [
    (("--height", "0"), "--height: expected a number above 0, got 0"),
    (("--up", "1,2"), "--up: expected 3 numbers, with commas between, got 1,2"),
    (("--ball", "0,0,0,nan"), "--ball: expected 4 numbers"), (("--ball", "0,0,0,-1"), "expected a radius above 0"),
    (("--box", "0,0,0,1,1,0"), "--box: expected two opposite corners"),
    (("--distance", "a", "b", "far"), "--distance: expected 1 number, got far"),
    (("--yaw", "nan", "--height", "1"), "--yaw: expected a number of degrees, got nan"),
    (("--seed", "-1", "--height", "1"), "--seed: expected a whole number from 0 to 2**64 - 1, got -1"),
    (("--size", "9999"), "--size: expected 16 to 2048, got 9999"), ((), "expected a length"),
    (("--resolution", "8"), "--resolution: expected 32 to 512, got 8"),
    (("--steps", "9"), "--steps: expected 10 to 100000, got 9"),
    (("--linear",), "--linear: expected none with photographs"),
])
def test_the_command_line_tells_what_is_wrong(written: Path, options: tuple[str, ...], rule: str, tmp_path: Path,
                                              capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", "capture", str(written), "--licence", "CC0-1.0", "--out", str(tmp_path / "out"),
                 *options]) == 2
    assert rule in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_a_small_capture_is_fitted(written: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All of it once, with the true fit, which knows nothing of the object but 14 photographs of 48 pixels."""
    assert main(["import", "capture", str(written), "--licence", "CC0-1.0", "--out", str(tmp_path), "--height", "0.75",
                 "--size", "48", "--resolution", "32", "--steps", "60", "--backend", "llvm"]) == 0
    said = capsys.readouterr().out
    assert "density field of 14 images of 48 pixels; 2 images held out" in said
    content = read_field(tmp_path / "thing.npz")
    assert content.record.psnr > 22 and content.record.opacity_iou > 0.9
    width, depth, height = content.mesh.size
    assert height == pytest.approx(0.75) and abs(width - 0.7) < 0.08 and abs(depth - 0.4) < 0.08
    # The ball on the box is to the right, for those who stand before the front
    top = content.mesh.positions[content.mesh.positions[:, 2] > 0.5]
    assert np.abs(top.mean(axis=0)[:2] - [0.12, 0]).max() < 0.05
    assert (tmp_path / "report" / "thing.png").stat().st_size > 1000


def test_a_folder_called_capture_is_still_one_of_models(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                        capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "capture").mkdir()
    assert main(["import", "capture", "--licence", "CC0-1.0"]) == 2
    assert "capture: left out" in capsys.readouterr().err or not (tmp_path / "captures").exists()
