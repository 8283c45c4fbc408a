"""OFF, text: polygons, with colours of vertices (COFF) or faces.

Geomview's manual, "OFF Files", http://www.geomview.org/docs/html/OFF.html
"""

import re
from pathlib import Path
from typing import NoReturn

import numpy as np

from dataset_builder.assets.file_model import GREY, FileModel, FilePart, refuse
from dataset_builder.assets.linear_texels import linear_rgba
from dataset_builder.assets.readers.polygon_checks import (
    checked_triangles,
    content_of,
    crossing,
    numbers_of,
    polygon_counts,
)
from dataset_builder.spec.problems import shown

KEYWORD = re.compile(rb"(ST)?(C)?(N)?(4)?(n)?OFF\s*(BINARY)?\s*")
NO_COLOR = [*(np.full(3, 1.055 * GREY ** (1 / 2.4) - 0.055)).tolist(), 1.0]
"""The grey of what has none, in sRGB, of faces beside others with colours."""
Line = tuple[int, bytes]
"""Number and text, without its comment and never blank."""


def read(path: Path, max_texture: int) -> FileModel:
    """The whole file. Raises UserError where it breaks the format or does not hold what it declares."""
    lines = [(number, text) for number, line in enumerate(content_of(path).splitlines(), start=1)
             if (text := line.split(b"#", 1)[0].strip())]
    (texture, color, normal), lines = _keyword(path, lines)
    (vertices, faces), lines = _counts(path, lines)
    if len(lines) != vertices + faces:
        got = min(vertices, len(lines))
        refuse(path, f"expected {vertices} vertices and {faces} faces, a line each, got {got} and {len(lines) - got}")
    if not faces:
        refuse(path, f"expected faces, got none: a cloud of {vertices} points", "reconstruct a surface of it")
    before, after = 6 if normal else 3, 2 if texture else 0
    rows = _vertices(path, lines[:vertices], [before + many + after for many in ((3, 4) if color else (0,))])
    counts, indices, face_colors = _faces(path, lines[vertices:])
    found = checked_triangles(path, rows[:, :3], indices, counts)
    colors, lost = None, []
    if color and vertices:
        last = rows.shape[1] - after
        shares = any(b"." in word for word in lines[0][1].split()[before:last])
        colors = _linear(path, rows[:, before:last] / (1 if shares else 255))[indices]
        lost += ["colours of faces beside those of vertices"] if face_colors is not None else []
    elif face_colors is not None:
        colors = np.repeat(_linear(path, face_colors), counts, axis=0)
    lost += ["texture coordinates, for which the format names no texture"] if texture else []
    part = FilePart(name="faces", positions=rows[:, :3], faces=indices[found.corners],
                    colors=None if colors is None else colors[found.corners])
    lost += ["colours taken as sRGB"] if colors is not None else []
    return FileModel(parts=(part,), materials=(), left_out=(*lost, *crossing(found)),
                     contains=polygon_counts(vertices, faces, found))


def _keyword(path: Path, lines: list[Line]) -> tuple[tuple[bool, bool, bool], list[Line]]:
    """Whether vertices have texture coordinates, colours and normals, and the lines after the keyword, which may be
    left out; some files have the counts on its line."""
    if not lines:
        refuse(path, "expected an OFF file, got an empty one")
    number, text = lines[0]
    match = KEYWORD.match(text)
    if match is None:
        return (False, False, False), lines
    if match[4] or match[5] or match[6]:
        refuse(path, f"expected OFF, COFF, NOFF or STOFF as text, got {shown(match[0].decode())}",
               "four dimensions, dimensions by number and binary data are not read", at=f"line {number}")
    rest = text[match.end():]
    return (bool(match[1]), bool(match[2]), bool(match[3])), [*([(number, rest)] if rest else []), *lines[1:]]


def _counts(path: Path, lines: list[Line]) -> tuple[tuple[int, int], list[Line]]:
    """How many vertices and faces there are, and the lines after that; the number of edges may be wrong or missing."""
    number, text = lines[0] if lines else (1, b"")
    words = text.split()
    if len(words) not in (2, 3) or not all(word.isdigit() and len(word) < 19 for word in words):
        _refuse_line(path, (number, text), "expected the keyword OFF or the numbers of vertices, faces and edges")
    return (int(words[0]), int(words[1])), lines[1:]


def _vertices(path: Path, lines: list[Line], widths: list[int]) -> np.ndarray:
    """(V, width) numbers of the vertices."""
    wide = len(lines[0][1].split()) if lines else widths[0]
    for line in lines:
        if len(line[1].split()) != wide or wide not in widths:
            _refuse_line(path, line, f"expected {' or '.join(map(str, widths))} numbers of a vertex")
    numbers = numbers_of(b" ".join(text for _, text in lines))
    if numbers is None:
        wrong = next(line for line in lines if numbers_of(line[1]) is None)
        _refuse_line(path, wrong, "expected numbers of a vertex")
    return numbers.reshape(-1, wide)


def _faces(path: Path, lines: list[Line]) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """(F,) numbers of corners, (C,) corners, and (F, 4) sRGB colours and coverage if any face has them."""
    counts, corners, colors = list[int](), list[int](), list[list[float]]()
    coloured = False
    for line in lines:
        words = line[1].split()
        try:
            many = int(words[0])
            own = [int(word) for word in words[1:many + 1]] if many > 0 else []
            rest = [float(word) for word in words[many + 1:]] if many >= 0 else []
        except ValueError:
            _refuse_line(path, line, "expected numbers of a face")
        if many < 0 or len(own) != many or len(rest) not in (0, 1, 3, 4) or any(abs(index) >= 2**31 for index in own):
            _refuse_line(path, line, f"expected {words[0].decode()} corners and 0, 1, 3 or 4 numbers of a colour")
        if len(rest) == 1:
            _refuse_line(path, line, "expected a colour as 3 or 4 numbers, not as one of a colour map")
        coloured |= bool(rest)
        most = 1 if any(b"." in word for word in words[many + 1:]) else 255
        colors.append([*(value / most for value in rest), *[1.0] * (4 - len(rest))] if rest else NO_COLOR)
        counts.append(many)
        corners += own
    return (np.array(counts, dtype=np.int64), np.array(corners, dtype=np.int64),
            np.array(colors) if coloured else None)


def _linear(path: Path, colors: np.ndarray) -> np.ndarray:
    """(N, 4) float32 linear colours and coverage of (N, 3 or 4) sRGB ones."""
    if not ((colors >= 0) & (colors <= 1)).all():
        refuse(path, "expected colours in [0, 1], with decimal points, or whole numbers in [0, 255], got others")
    return linear_rgba(colors)


def _refuse_line(path: Path, line: Line, rule: str) -> NoReturn:
    refuse(path, f"{rule}, got {shown(line[1].decode('latin-1'))}", at=f"line {line[0]}")
