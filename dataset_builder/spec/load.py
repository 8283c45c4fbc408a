"""YAML 1.2 in, plain data with line numbers out. The only module that knows YAML.

`1e-3` is a number and `no` is text; anchors and merge keys work; duplicate keys and tags are errors.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unicodedata import category

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import CollectionEndEvent, CollectionStartEvent, Event, NodeEvent
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.reader import ReaderError

from dataset_builder.digest import read_regular
from dataset_builder.errors import Problem, SpecError
from dataset_builder.spec.document import BadOverride, Document, Override, apply
from dataset_builder.spec.problems import dotted, shown
from dataset_builder.spec.resolve import LoadedSpec, Resolver

STANDARD_TAG = "tag:yaml.org,2002:"
SCALAR_TAGS = ("int", "float", "bool", "null")
TEXT_TAGS = ("str", "timestamp")
MOST_BITS = 1023
"""Of a whole number: any float holds it."""
MERGE_KEY = "<<"
MOST_BYTES, MOST_NODES, MOST_DEPTH = 2**20, 20_000, 40
"""Limits of one file: its size; its keys and values, counted wherever an alias or a merge repeats them; nesting."""


def load_dataset(path: Path | str, overrides: Sequence[str] = ()) -> LoadedSpec:
    """The dataset at `path` with every file that it names, checked.

    overrides: `key.path=value` strings, applied in order to the dataset file before it is validated; list entries are
    named by index or by their `name`. Raises SpecError with every broken rule of every file at once.
    """
    document, problems = overridden(read_document(Path(path), str(path)), overrides)
    loaded = Resolver(read=read_document, root=Path(path), problems=problems).dataset(document)
    return replace(loaded, overrides=tuple(overrides))


def overridden(document: Document, overrides: Sequence[str]) -> tuple[Document, list[Problem]]:
    """The document with `key.path=value` strings applied in order, and what is wrong with those that could not be."""
    parsed: list[Override] = []
    problems: list[Problem] = []
    for text in overrides:
        try:
            parsed.append(parse_override(text))
        except SpecError as error:
            problems.extend(error.problems)
    for override in parsed:
        try:
            document = apply(document, override)
        except BadOverride as error:
            problems.append(error.problem)
    return document, problems


def parse_override(text: str) -> Override:
    """The override that `text` means, its value parsed as YAML. Raises SpecError where it is not KEY=VALUE."""
    where = f"--set {text}"
    key, equals, value = text.partition("=")
    keys = tuple(key.strip().split("."))
    if len(keys) > MOST_DEPTH:
        rule = f"expected a path of at most {MOST_DEPTH} keys, got {len(keys)}"
        raise SpecError([Problem(where=f"--set {shown(key)}", path="", rule=rule)])
    if not equals or not all(keys):
        raise SpecError([Problem(where=where, path="", rule=f"expected KEY=VALUE, such as seed=7, got {shown(text)}")])
    try:
        return Override(text=text, keys=keys, value=read_text(value, "").data)
    except SpecError as error:
        raise SpecError(replace(problem, where=where) for problem in error.problems) from error


def read_document(path: Path, name: str) -> Document:
    """The file at `path` as plain data, called `name` in messages.

    Raises SpecError where it cannot be read, is not UTF-8, is no valid YAML, or is not a mapping of keys.
    """
    document = read_text(_text(path, name), name)
    if not isinstance(document.data, dict):
        got = "an empty file" if document.data is None else f"a {_kind(document.data)}"
        raise SpecError([Problem(where=f"{name}:1", path="", rule=f"expected a mapping of keys, got {got}")])
    return document


def read_text(text: str, name: str) -> Document:
    """YAML text as plain data, called `name` in messages. Raises SpecError where it is not valid, or has tags."""
    reader = _Reader(name)
    try:
        node = reader.compose(text)
        data = None if node is None else reader.plain(node, ())
    except ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise _syntax_error(f"{name}:{line}", f"a character that YAML forbids ({error.character!r})") from error
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise _syntax_error(f"{name}:{mark.line + 1}" if mark else name, str(error.problem)) from error
    except YAMLError as error:
        raise _syntax_error(name, str(error)) from error
    except RecursionError as error:
        raise _syntax_error(name, "nesting too deep to read") from error
    if reader.problems:
        raise SpecError(dict.fromkeys(reader.problems))
    return Document(name=name, data=data, places=reader.places)


def _text(path: Path, name: str) -> str:
    try:
        return read_regular(path, most=MOST_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        rule = f"expected UTF-8 text, got byte 0x{error.object[error.start]:02x} at offset {error.start}"
    except FileNotFoundError:
        rule = "expected a file, found none"
    except (OSError, ValueError) as error:
        rule = f"expected a readable file, got: {getattr(error, 'strerror', error)}"
    raise SpecError([Problem(where=name, path="", rule=rule)])


def _syntax_error(where: str, problem: str) -> SpecError:
    return SpecError([Problem(where=where, path="", rule=f"expected valid YAML, got: {problem}",
                              hint="indent with spaces, no tabs" if "\\t" in problem else "")])


def _kind(data: Any) -> str:
    return "list" if isinstance(data, tuple) else "single value"


class _Reader:
    """Turns the nodes of one text into plain data; gathers problems and the place of every path."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.yaml = YAML(typ="safe", pure=True)
        self.problems: list[Problem] = []
        self.places: dict[tuple[str | int, ...], str] = {}
        self.above: list[Node] = []
        self.count = 0

    def compose(self, text: str) -> Node | None:
        """The nodes of a text. Raises SpecError where there is too much of it, before all are made."""
        count = depth = 0
        for event in self.yaml.parse(text):
            count += isinstance(event, NodeEvent)
            depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
            self._limit(event, count, depth)
        node: Node | None = self.yaml.compose(text)
        return node

    def plain(self, node: Node, path: tuple[str | int, ...]) -> Any:
        """Data of `node`, which stands at `path`. Raises SpecError where there is too much of it."""
        self.count += 1
        self._limit(node, self.count, len(path))
        self.places.setdefault(path, self._place(node))
        if isinstance(node, ScalarNode):
            return self._scalar(node, path)
        if node in self.above:
            return self._problem(node, path, "expected data without cycles, got an alias to an enclosing node")
        self.above.append(node)
        try:
            if isinstance(node, MappingNode):
                return self._mapping(node, path)
            return tuple(self.plain(item, (*path, index)) for index, item in enumerate(node.value))
        finally:
            self.above.pop()

    def _limit(self, node: Node | Event, count: int, depth: int) -> None:
        if count > MOST_NODES or depth > MOST_DEPTH:
            rule = (f"expected valid YAML of at most {MOST_NODES} keys and values, aliases repeated, nested at most "
                    f"{MOST_DEPTH} deep")
            raise SpecError([Problem(where=self._place(node), path="", rule=rule)])

    def _place(self, node: Node | Event) -> str:
        return f"{self.name}:{node.start_mark.line + 1}"

    def _problem(self, node: Node, path: tuple[str | int, ...], rule: str) -> None:
        self.problems.append(Problem(where=self._place(node), path=dotted(path), rule=rule))

    def _scalar(self, node: ScalarNode, path: tuple[str | int, ...]) -> Any:
        kind = str(node.tag).removeprefix(STANDARD_TAG)
        if kind in TEXT_TAGS:
            return self._text(node, path)
        if kind not in SCALAR_TAGS:
            return self._problem(node, path, f"expected plain YAML without tags, got {kind}")
        try:
            value = self.yaml.constructor.construct_object(node)
            if isinstance(value, int) and value.bit_length() > MOST_BITS:
                raise ValueError("no float holds it")
            return value
        except ValueError:
            return self._problem(node, path, f"expected a number that can be read, got {shown(str(node.value))}")

    def _text(self, node: ScalarNode, path: tuple[str | int, ...]) -> Any:
        text = str(node.value)
        if bad := next((one for one in text if one not in "\n\t" and category(one) in ("Cc", "Cs")), None):
            return self._problem(node, path, f"expected text without control characters, got {bad!r} in {shown(text)}")
        return text

    def _mapping(self, node: MappingNode, path: tuple[str | int, ...]) -> dict[str, Any]:
        written: dict[str, Node] = {}
        data = self._merged(node, path)
        for key, value in self._entries(node, path):
            if first := written.get(key.value):
                self._problem(key, (*path, key.value), "expected each key once, got it again "
                              f"(first at line {first.start_mark.line + 1})")
                continue
            written[key.value] = key
            self.places[(*path, key.value)] = self._place(key)
            data[key.value] = self.plain(value, (*path, key.value))
        return data

    def _entries(self, node: MappingNode, path: tuple[str | int, ...]) -> Iterator[tuple[ScalarNode, Node]]:
        for key, value in node.value:
            if not isinstance(key, ScalarNode) or str(key.tag).removeprefix(STANDARD_TAG) not in (*TEXT_TAGS, "merge"):
                self._problem(key, path, f"expected text as a key, got {shown(key.value)}; put it in quotes")
            elif key.value != MERGE_KEY:
                yield key, value

    def _merged(self, node: MappingNode, path: tuple[str | int, ...]) -> dict[str, Any]:
        """What merge keys bring in; keys written out go before them, earlier maps of a list before later ones."""
        data: dict[str, Any] = {}
        for key, value in node.value:
            if isinstance(key, ScalarNode) and key.value == MERGE_KEY:
                for source in value.value if isinstance(value, SequenceNode) else [value]:
                    if isinstance(source, MappingNode):
                        data = self.plain(source, path) | data
                    else:
                        self._problem(key, path, "expected a mapping to merge")
        return data
