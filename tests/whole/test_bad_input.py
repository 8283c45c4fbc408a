"""Whatever a user does wrong is told on the command line: exit code 2, where and what, nothing half written."""

import errno
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import pytest

from dataset_builder.cli.main import main
from dataset_builder.shards.folder import Claim
from dataset_builder.shards.one_writer import build_lock
from tests.shards.tiny_dataset import shard_path
from tests.small_specs import FILES, contents, write_spec

Run = Callable[..., str]
DATASET = FILES["small.yaml"]
PLY = """\
ply
format ascii 1.0
element vertex {vertices}
property float x
property float y
property float z
element face {faces}
property list uchar int vertex_indices
end_header
"""
TRIANGLE = "v 0 0 0\nv 1 0 0\nv {} 1 0\nf 1 2 3\n"


@pytest.fixture
def refused(capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs a command line that must be refused; gives what it says."""

    def run(*arguments: object) -> str:
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
        said = capsys.readouterr()
        assert code == 2 and said.err
        assert "Traceback" not in said.err + said.out
        return said.err

    return run


@pytest.mark.parametrize("arguments", [("plan", "spec.yaml", "--views", "0"), ("inspect", "folder", "--rows", "-1")])
def test_counts_start_at_one(refused: Run, arguments: tuple[str, ...]) -> None:
    assert f"argument {arguments[-2]}: expected a whole number >= 1, got {arguments[-1]}" in refused(*arguments)


@pytest.mark.parametrize(("changed", "message"), [
    ({"small.yaml": DATASET + "sigmaa: 1\n"}, "small.yaml:20: sigmaa: expected no such key, got 1"),
    ({"small.yaml": DATASET.replace("max_depth: 4", "max_depth: four")},
     "small.yaml:8: render.max_depth: expected a whole number or auto, got 'four'"),
    ({"small.yaml": DATASET.replace("seed: 1", "seed: 1\nseed: 2")}, "small.yaml:3: seed: expected each key once"),
    ({"small.yaml": DATASET.replace("0.0, 0.006", "-0.1")}, "small.yaml:9: rough.sigma[0]: expected >= 0, got -0.1"),
    ({"small.yaml": DATASET + "target: {lights: 0}\n"}, "small.yaml:20: target.lights: expected in [1, 1024], got 0"),
    ({"small.yaml": DATASET.replace("lights: 2", "lights: 0")},
     "small.yaml:16: splits[0].lights: expected >= 1, got 0"),
    ({"small.yaml": DATASET.replace("name: small", "\tname: small")}, "small.yaml:1: expected valid YAML"),
    ({"objects/cabinet.yaml": "file: mesh.glb\nlicence: CC0-1.0\n"},
     "objects/cabinet.yaml:1: file: expected a mesh file, found none at 'mesh.glb'"),
    ({"objects/cabinet.yaml": "file: mesh.obj\nlicence: CC0-1.0\n", "objects/mesh.obj": ""},
     "objects/mesh.obj: expected triangles, got a file without any"),
    ({"objects/stool.yaml": "file: mesh.ply\nlicence: CC0-1.0\n", "objects/mesh.ply": PLY.format(vertices=0, faces=0)},
     "objects/mesh.ply: expected faces, got none"),
    ({"objects/cabinet.yaml": "file: mesh.obj\nlicence: CC0-1.0\n", "objects/mesh.obj": TRIANGLE.format("nan")},
     "objects/mesh.obj: line 3: expected finite vertices, got 1 with NaN, Inf or more than 1e30"),
    ({"objects/cabinet.yaml": "file: mesh.glb\nlicence: CC0-1.0\n", "objects/mesh.glb": b"glTF\x02"},
     "objects/cabinet.yaml:1: file: "),
    ({"small.yaml": DATASET.replace("coverage: [0.1, 0.5]", "coverage: [0.94, 0.95], visibility: 1, attempts: 5")},
     "camera: expected a camera that sees the object on 0.94 to 0.95 of the frame with visibility >= 1"),
    ({"rooms/den.yaml": "width: 1\ndepth: 1\n"}, " outside the room at any coverage"),
    ({"small.yaml": DATASET + "target: {strength: 1e-6, attempts: 3}\n"}, "target: expected"),
])
def test_a_spec_that_will_not_do(tmp_path: Path, refused: Run, changed: dict[str, str | bytes], message: str) -> None:
    said = refused("build", write_spec(tmp_path, changed), "--out", tmp_path / "out", "--workers", "1")
    assert message in said and all(line.startswith("error: ") for line in said.splitlines())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("arguments", "message"), [
    (["--set", "rough.sigma=-1"], "--set rough.sigma=-1: rough.sigma: expected >= 0, got -1"),
    (["--set", "spp"], "--set spp: expected KEY=VALUE"),
    (["--set", "rneder.spp=4"], "rneder: expected no such key, got {spp: 4} (nearest known key: render)"),
    (["--example", "10"], "example: expected an example in [0, 10), got 10"),
    (["--example", "999999", "--example", "-1"], "--example: expected the index of an example, 0 or more, got -1"),
    (["--example", "two"], "--example: expected the index of an example, 0 or more, got two"),
    (["--workers", "0"], "argument --workers: expected a whole number >= 1, got 0"),
    (["--workers", "two"], "argument --workers: expected a whole number >= 1, got two"),
    (["--backend", "opencl"], "argument --backend: invalid choice"),
])
def test_an_option_that_will_not_do(small_spec: Path, tmp_path: Path, refused: Run, arguments: list[str],
                                    message: str) -> None:
    assert message in refused("build", small_spec, "--out", tmp_path / "out", *arguments)
    assert not (tmp_path / "out").exists()


def test_specs_that_are_none(tmp_path: Path, refused: Run) -> None:
    assert "none.yaml: expected a file, found none" in refused("build", tmp_path / "none.yaml", "--out", tmp_path / "o")
    assert "expected a readable file, got: Is a directory" in refused("plan", tmp_path)
    assert "example: expected an example in [0, 10), got 10" in refused("plan", write_spec(tmp_path), "--example", 10)
    assert "family: expected one of" in refused("families", "chiar")
    assert "expected a finished dataset, found no such file" in refused("inspect", tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["objects", "rooms", "scenes", "small.yaml"]


def test_an_output_that_cannot_be(small_spec: Path, small_dataset: Path, tmp_path: Path, refused: Run) -> None:
    (tmp_path / "file").write_text("mine")
    build = ["build", small_spec, "--workers", "1", "--out"]
    assert "expected a folder, got a file" in refused(*build, tmp_path / "file")
    assert f"{tmp_path}/file/out: cannot be written" in refused(*build, tmp_path / "file" / "out")
    assert "expected a new or empty folder, or a dataset of this builder, got other files" in refused(*build, tmp_path)
    assert "cannot be written" in refused("inspect", small_dataset, "--sheet", tmp_path / "file" / "sheet.png")
    assert "cannot be written" in refused("schema", tmp_path / "file" / "schema")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("file", "mine")]


def test_a_disk_that_is_too_small_is_refused_before_anything_is_made(
        small_spec: Path, tmp_path: Path, refused: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage._replace(free=100_000))
    said = refused("build", small_spec, "--out", tmp_path / "out", "--workers", "1")
    assert re.search(r"out: expected [0-9.]+ KiB free, got 97\.7 KiB \(choose another disk\)", said)
    assert not (tmp_path / "out").exists()
    (tmp_path / "out").mkdir()
    assert " KiB free, got 97.7 KiB" in refused("build", small_spec, "--out", tmp_path / "out", "--workers", "1")
    assert contents(tmp_path / "out") == {}


@pytest.mark.parametrize(("code", "message"), [
    (errno.ENOSPC, "the disk is full (No space left on device) (free some space and run the same command again)"),
    (errno.EACCES, "cannot be written (Permission denied)"),
    (errno.EROFS, "cannot be written (Read-only file system)"),
])
def test_a_disk_that_refuses_later(small_spec: Path, tmp_path: Path, refused: Run, monkeypatch: pytest.MonkeyPatch,
                                   code: int, message: str) -> None:
    def refuse(descriptor: int) -> NoReturn:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(os, "fsync", refuse)
    command = ["build", small_spec, "--out", tmp_path / "out", "--workers", "1", "--example", "8"]
    assert message in refused(*command)
    assert [path for path in (tmp_path / "out").rglob("*") if path.is_file()] == []


def test_two_builds_in_one_folder(small_spec: Path, tmp_path: Path, refused: Run) -> None:
    with build_lock(tmp_path / "out", Claim(name="small", version="1.0.0")):
        said = refused("build", small_spec, "--out", tmp_path / "out", "--workers", "1")
    assert f"out: another build is running in this folder (process {os.getpid()})" in said
    assert contents(tmp_path / "out") == {}


def test_a_changed_byte_is_found_and_named(small_dataset: Path, tmp_path: Path,
                                           capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copytree(small_dataset, tmp_path / "copy")
    assert main(["verify", str(tmp_path / "copy")]) == 0
    assert "10 examples in 6 shards" in capsys.readouterr().out
    path = shard_path(tmp_path / "copy", "small-v1-train-000001")
    data = bytearray(path.read_bytes())
    data[5000] ^= 1
    path.write_bytes(data)
    assert main(["verify", str(tmp_path / "copy")]) == 1
    said = capsys.readouterr().out
    assert f"wrong: {path.name}: expected SHA-256" in said and "small-v1-train-000000" not in said
    assert f"wrong: {path.name}: 00000002." in said


def test_the_program_itself(tmp_path: Path) -> None:
    spec = write_spec(tmp_path, {"small.yaml": DATASET + "sigmaa: 1\n"})
    done = subprocess.run([sys.executable, "-m", "dataset_builder", "build", str(spec), "--out", "out"],
                          capture_output=True, text=True, cwd=tmp_path, check=False,
                          env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])})
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr == f"error: {spec}:20: sigmaa: expected no such key, got 1 ({known_keys(done.stderr)})\n"
    assert not (tmp_path / "out").exists()


def known_keys(text: str) -> str:
    """The hint at the end of a message."""
    return text.rpartition(" (")[2].rstrip(")\n")


def test_an_interrupted_build_says_how_to_go_on(small_spec: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                capsys: pytest.CaptureFixture[str]) -> None:
    def interrupt(*_: Any) -> NoReturn:
        raise KeyboardInterrupt

    monkeypatch.setattr("dataset_builder.builder.run_unit", interrupt)
    assert main(["build", str(small_spec), "--out", str(tmp_path / "out"), "--workers", "1"]) == 130
    assert "run the same command again to continue" in capsys.readouterr().err
