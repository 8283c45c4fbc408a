"""Which files an OBJ names, in its words and those of MTL."""

from pathlib import Path

import pytest

from dataset_builder.spec.mesh_source import companions, mesh_source, references
from dataset_builder.spec.obj_references import READ_MAPS


@pytest.mark.parametrize(("written", "name"), [
    ("wood.png", "wood.png"), ("old oak.png", "old oak.png"), ("-s 1 1 1 old oak.png", "old oak.png"),
    ("-o 0.5 wood.png", "wood.png"), ("-t 1e-3 -.5 0 2.png", "2.png"), ("-mm 0 1 -bm 0.2 -imfchan r b.png", "b.png"),
    ("-blendu off -clamp on  sub/w.png", "sub/w.png"), ("-s 1 1 1 4k wood.png", "4k wood.png"),
])
def test_options_come_before_the_name_of_a_map(tmp_path: Path, written: str, name: str) -> None:
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl m\n")
    (tmp_path / "a.mtl").write_text(f"newmtl m\n  map_Bump {written} \n")
    assert companions(tmp_path / "a.obj") == tuple(sorted(("a.mtl", name)))


def test_what_is_written_and_where_it_lies(tmp_path: Path) -> None:
    (tmp_path / "mats").mkdir()
    (tmp_path / "a.obj").write_text("# mtllib no.mtl\nmtllib mats/a.mtl\nv 0 0 0\nmtllib gone.mtl\nusemtl n\n"
                                    "usemtl m\n")
    (tmp_path / "mats" / "a.mtl").write_text("newmtl m\nKd 1 1 1\nmap_Kd ../w.png\nnewmtl n\nmap_Kd ../w.png\n"
                                             "norm n.png\ndisp d.png\nnewmtl unused\nmap_Kd gone.png\n")
    found = [(reference.by.name, reference.key, reference.name, reference.image)
             for reference in references(tmp_path / "a.obj")]
    assert found == [("a.obj", "line 2: mtllib", "mats/a.mtl", False), ("a.obj", "line 4: mtllib", "gone.mtl", False),
                     ("a.mtl", "line 5: map_Kd", "w.png", True), ("a.mtl", "line 6: norm", "mats/n.png", True),
                     ("a.mtl", "line 3: map_Kd", "w.png", True)]


@pytest.mark.parametrize("key", READ_MAPS)
def test_every_map_that_is_read_is_part_of_the_digest(tmp_path: Path, key: str) -> None:
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl m\n")
    (tmp_path / "a.mtl").write_text(f"newmtl m\n{key} w.png\n")
    digests = set()
    for content in (b"one", b"other"):
        (tmp_path / "w.png").write_bytes(content)
        digests.add(mesh_source(tmp_path / "a.obj", companions(tmp_path / "a.obj")).digest)
    assert len(digests) == 2


@pytest.mark.parametrize(("line", "names"), [
    ("a.mtl b.mtl", ["a.mtl", "b.mtl"]), ("old oak.mtl", ["old oak.mtl"]), ("c d.mtl e.mtl", ["c d.mtl e.mtl"]),
    ("a.mtl # first", ["a.mtl"]), ("x.mtl y.mtl", ["x.mtl y.mtl"]), (".\\a.mtl", ["a.mtl"]), ("A.MTL", ["A.MTL"])])
def test_libraries_on_a_line(tmp_path: Path, line: str, names: list[str]) -> None:
    """`x.mtl y.mtl` is there as one file."""
    for name in ("a.mtl", "b.mtl", "x.mtl y.mtl"):
        (tmp_path / name).write_text("")
    (tmp_path / "a.obj").write_text(f"mtllib {line}\n")
    assert [reference.name for reference in references(tmp_path / "a.obj")] == names
