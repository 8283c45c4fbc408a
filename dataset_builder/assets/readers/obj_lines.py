"""The lines of an OBJ file -> arrays, many lines at once: a loop over two million faces would take a minute."""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from dataset_builder.assets.readers.polygon_checks import FARTHEST, numbers_of
from dataset_builder.spec.wavefront import as_text, line_at

CHUNK_BYTES = 2**23
FIGURES = {b"v": "vertices", b"vt": "texture coordinates", b"vn": "normals", b"f": "faces"}
ALLOWED = {b"v": "3, 4, 6 or 7 numbers", b"vt": "1 to 3 numbers", b"vn": "3 numbers", b"f": "3 to 65535 corners"}
"""Values of a line. A vertex may have a weight, or a colour, or a colour and its coverage; so many corners of a polygon
are few enough for ears to be clipped."""
COUNTS = {b"v": (3, 4, 6, 7), b"vt": (1, 2, 3), b"vn": (3,), b"f": range(3, 2**16)}
"""The same as numbers."""
IGNORED, RUNS = (b"mtllib", b"s"), (b"call", b"csh")
INTEGERS = np.array([1, 2, 2, 3])
"""Numbers in a corner of each form: v, v/vt, v//vn, v/vt/vn."""


@dataclass(kw_only=True, eq=False)
class ObjLines:
    """An OBJ file in arrays, as far as it has been read."""

    data: bytes
    vertices: list[np.ndarray] = field(default_factory=list)
    """(N, 7) each: position, colour and coverage; NaN where a line has none."""
    texcoords: list[np.ndarray] = field(default_factory=list)
    """(N, 2) each."""
    normals: int = 0
    corners: list[np.ndarray] = field(default_factory=list)
    """(C, 3) each: indices from 0 of vertex, texture coordinates and normal of every corner, -1 for none."""
    counts: list[np.ndarray] = field(default_factory=list)
    """(F,) corners of each face."""
    labels: list[np.ndarray] = field(default_factory=list)
    """(F, 3) each: number of its material and of its object, -1 for none, and the offset of its line."""
    materials: dict[str, int] = field(default_factory=dict)
    objects: dict[str, int] = field(default_factory=dict)
    others: Counter[str] = field(default_factory=Counter)
    """Statements that are not read, by their key."""
    notes: Counter[str] = field(default_factory=Counter)
    """Values that are not used, in words."""
    faults: dict[str, tuple[int, int]] = field(default_factory=dict)
    """What breaks the format, in words: how often, and the line where it does first."""
    current: list[int] = field(default_factory=lambda: [-1, -1])
    sizes: list[int] = field(default_factory=lambda: [0, 0, 0])
    """How many vertices, texture coordinates and normals there have been."""

    def fault(self, rule: str, offsets: np.ndarray) -> None:
        """Note lines, by their offsets, that break a rule."""
        if len(offsets):
            count, line = self.faults.get(rule, (0, line_at(self.data, int(offsets[0]))))
            self.faults[rule] = (count + len(offsets), line)


def read_lines(data: bytes) -> ObjLines:
    """All lines of what `obj_bytes` gives."""
    found = ObjLines(data=data)
    start = 0
    while start < len(data) and not found.faults:
        end = data.find(b"\n", min(start + CHUNK_BYTES, len(data)))
        end = len(data) if end < 0 else end + 1
        _Chunk(found, data[start:end], start).read()
        start = end
    return found


class _Chunk:
    """Whole lines of the file, their tokens, and which line each token is in."""

    def __init__(self, found: ObjLines, text: bytes, base: int):
        self.found, self.text, self.base = found, text + b"\n  ", base
        self.bytes = np.frombuffer(self.text, dtype=np.uint8).copy()
        self.ends = np.flatnonzero(self.bytes == ord("\n"))
        self.starts = np.concatenate([[0], self.ends[:-1] + 1])
        self._blank_comments()
        blank = self.bytes <= ord(" ")
        self.tokens = np.flatnonzero(~blank & np.concatenate([[True], blank[:-1]]))
        first = np.searchsorted(self.tokens, self.starts)
        self.values = np.searchsorted(self.tokens, self.ends) - first - 1
        self.keys = self.tokens[np.minimum(first, len(self.tokens) - 1)] if len(self.tokens) else first
        self.lines = {key: self._lines_of(key) for key in FIGURES}

    def _blank_comments(self) -> None:
        marks = np.flatnonzero(self.bytes == ord("#"))
        if len(marks):
            lines, first = np.unique(np.searchsorted(self.ends, marks), return_index=True)
            step = np.zeros(len(self.bytes), dtype=np.int8)
            step[marks[first]] += 1
            step[self.ends[lines]] -= 1
            self.bytes[np.cumsum(step, dtype=np.int8) > 0] = ord(" ")

    def _lines_of(self, key: bytes) -> np.ndarray:
        """(L,) whether a line has that key."""
        same = self.values >= 0
        for place, byte in enumerate(key):
            same &= self.bytes[self.keys + place] == byte
        return same & (self.bytes[np.minimum(self.keys + len(key), len(self.bytes) - 1)] <= ord(" "))

    def read(self) -> None:
        """Add what is here to what has been found."""
        others = np.flatnonzero((self.values >= 0) & ~np.logical_or.reduce([*self.lines.values()]))
        labels = self._others(others)
        for key, lines in self.lines.items():
            wrong = lines & ~np.isin(self.values, list(COUNTS[key]))
            self.found.fault(f"expected {FIGURES[key]} of {ALLOWED[key]}, got {{}} with other than that",
                             self._at(wrong))
            lines &= ~wrong
        if len(self.tokens):
            self._vertices()
            self._texcoords()
            self._faces(labels)
        for place, key in enumerate((b"v", b"vt", b"vn")):
            self.found.sizes[place] += int(self.lines[key].sum())

    def _at(self, lines: np.ndarray) -> np.ndarray:
        return self.base + self.keys[lines]

    def _others(self, lines: np.ndarray) -> np.ndarray:
        """(L, 2) number of the material and of the object in force after each line."""
        found, changes, states = self.found, [-1], [tuple(self.found.current)]
        for line in lines:
            key, *more = self.text[self.keys[line]:self.ends[line]].split(maxsplit=1)
            rest = as_text(more[0]).strip() if more else ""
            if key == b"usemtl":
                found.current[0] = found.materials.setdefault(rest, len(found.materials))
            elif key in (b"o", b"g"):
                found.current[1] = found.objects.setdefault(rest, len(found.objects))
            elif key in RUNS:
                found.fault("expected no statement that reads other files or runs commands, got {}",
                            np.array([self.base + self.keys[line]]))
            elif key not in IGNORED:
                found.others[as_text(key)[:20]] += 1
                if self.base + self.ends[line] >= len(found.data) and not found.data.endswith(b"\n"):
                    found.fault("expected a whole last line, got {} that is cut short",
                                np.array([self.base + self.keys[line]]))
                continue
            changes.append(int(line))
            states.append(tuple(found.current))
        after = np.searchsorted(changes, np.arange(len(self.ends)), side="right") - 1
        return np.array(states, dtype=np.int64)[after]

    def _numbers(self, key: bytes, expected: np.ndarray, dtype: type) -> np.ndarray:
        """The numbers of all lines of a kind in a row, so many `expected` of each; none where one is unreadable, which
        is noted."""
        lines = self.lines[key]
        work = self.bytes.copy()
        for place in range(len(key)):
            work[self.keys[lines] + place] = ord(" ")
        if key == b"f":
            work[work == ord("/")] = ord(" ")
        here = np.repeat(lines, np.diff(self.ends, prepend=-1))
        numbers = numbers_of(work[:self.ends[-1] + 1][here].tobytes(), dtype)
        if numbers is not None and len(numbers) == expected.sum():
            return numbers
        bad = []
        for line, count in zip(np.flatnonzero(lines), expected, strict=True):
            words = work[self.starts[line]:self.ends[line]].tobytes().split()
            if len(words) != count or any(numbers_of(word, dtype) is None for word in words):
                bad.append(line)
        self.found.fault(f"expected {FIGURES[key]} of numbers, got {{}} with something else",
                         self._at(np.array(bad, dtype=np.int64)))
        return np.zeros(0, dtype)

    def _vertices(self) -> None:
        lines = self.lines[b"v"]
        counts = self.values[lines]
        if not len(numbers := self._numbers(b"v", counts, np.float64)):
            return
        made = np.full((len(counts), 7), np.nan)
        firsts = np.cumsum(counts) - counts
        for count in np.unique(counts):
            rows = counts == count
            made[rows, :count] = numbers[firsts[rows][:, None] + np.arange(count)]
        weighted = counts == 4
        self.found.notes["weights of vertices"] += int((made[weighted, 3] != 1).sum())
        made[weighted, 3] = np.nan
        bad = ~(np.abs(made[:, :3]) < FARTHEST).all(axis=1)
        self.found.fault("expected finite vertices, got {} with NaN, Inf or more than 1e30", self._at(lines)[bad])
        self.found.vertices.append(made)

    def _texcoords(self) -> None:
        counts = self.values[self.lines[b"vt"]]
        if not len(numbers := self._numbers(b"vt", counts, np.float64)):
            return
        firsts = np.cumsum(counts) - counts
        second = np.where(counts > 1, numbers[np.minimum(firsts + 1, len(numbers) - 1)], 0)
        made = np.stack([numbers[firsts], second], axis=1)
        bad = ~(np.abs(made) < FARTHEST).all(axis=1)
        self.found.notes["texture coordinates that are not finite, taken as (0, 0)"] += int(bad.sum())
        self.found.notes["third texture coordinates"] += int(np.count_nonzero(numbers[firsts[counts == 3] + 2]))
        made[bad] = 0
        self.found.texcoords.append(made)

    def _faces(self, labels: np.ndarray) -> None:
        lines = self.lines[b"f"]
        forms = self._forms()
        rows = np.flatnonzero(lines)
        first = np.searchsorted(self.tokens, self.keys[rows]) + 1
        counts = self.values[rows]
        own = np.repeat(first - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())
        form, owner = forms[own], np.repeat(np.arange(len(rows)), counts)
        mixed = np.unique(owner[(form != forms[first][owner]) | (form < 0)])
        self.found.fault("expected faces whose corners are all of one form (v, v/vt, v//vn or v/vt/vn), got {} that "
                         "have not", self._at(rows[mixed]))
        if len(mixed) or not len(rows):
            return
        if not len(numbers := self._numbers(b"f", counts * INTEGERS[forms[first]], np.int64)):
            return
        places = np.cumsum(INTEGERS[form]) - INTEGERS[form]
        corners = np.full((len(own), 3), -1, dtype=np.int32)
        for kind, (key, offset, forms_with) in enumerate(((b"v", 0, (0, 1, 2, 3)), (b"vt", 1, (1, 3)),
                                                          (b"vn", -1, (2, 3)))):
            has = np.isin(form, forms_with)
            before = (self.found.sizes[kind] + np.cumsum(self.lines[key]))[rows][owner[has]]
            said = numbers[places[has] + (offset if offset >= 0 else INTEGERS[form[has]] - 1)]
            index = np.where(said > 0, said - 1, before + said)
            for wrong, rule in ((said == 0, "from 1 on, or relative ones, got {} faces with the index 0"),
                                ((said < 0) & (index < 0), "that reach what stands above them, got {} faces that reach "
                                 "too far")):
                self.found.fault(f"expected indices {rule}", self._at(rows[np.unique(owner[has][wrong])]))
            corners[has, kind] = np.clip(index, -1, 2**31 - 1)
        self.found.corners.append(corners)
        self.found.counts.append(counts)
        self.found.labels.append(np.column_stack([labels[rows], self._at(rows)]))

    def _forms(self) -> np.ndarray:
        """(T,) form of every token as a corner: which of `INTEGERS`, -1 for what is none. Slashes at its end go."""
        for _ in range(2):
            slashes = np.flatnonzero(self.bytes == ord("/"))
            self.bytes[slashes[self.bytes[slashes + 1] <= ord(" ")]] = ord(" ")
        slashes = np.flatnonzero(self.bytes == ord("/"))
        token = np.searchsorted(self.tokens, slashes, side="right") - 1
        count = np.bincount(token, minlength=len(self.tokens))
        double = np.bincount(token[self.bytes[slashes + 1] == ord("/")], minlength=len(self.tokens))
        return np.where(count < 2, count, np.where(count == 2, 3 - double, -1))
