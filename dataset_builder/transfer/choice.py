"""Which examples of a dataset are wanted, chosen from its indexes alone."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from fnmatch import fnmatchcase
from types import MappingProxyType

from dataset_builder.errors import UserError
from dataset_builder.shards.folder import NAMED
from dataset_builder.shards.manifest import Manifest
from dataset_builder.shards.shard_index import ExampleFacts, ExampleRecord, ShardIndex, ShardRecord
from dataset_builder.shards.subset_record import Asked

FACTS: Mapping[str, Callable[[ExampleFacts], tuple[str, ...]]] = MappingProxyType({
    "scene": lambda facts: (facts.scene,),
    "object": lambda facts: (facts.object,),
    "category": lambda facts: (facts.category,),
    "level": lambda facts: (str(facts.level), facts.level_name),
    "light": lambda facts: (str(facts.light),),
})
"""What can be asked of an example, and what of it a pattern may match."""


@dataclass(frozen=True, kw_only=True)
class ExampleChoice:
    """What is wanted: patterns (`*`, `?`, `[...]`) of each kind, of which one must match; none match all. Every kind
    that is given must match."""

    split: tuple[str, ...] = ()
    scene: tuple[str, ...] = ()
    object: tuple[str, ...] = ()
    category: tuple[str, ...] = ()
    level: tuple[str, ...] = ()
    """Numbers or names of noise levels."""
    light: tuple[str, ...] = ()
    """Numbers of target lights among those of a view."""
    layers: tuple[str, ...] = ()
    """Labels and previews always come with them."""
    count: int | None = None
    """The first so many of every split that match all else; all where None."""

    def __post_init__(self) -> None:
        if self.count is not None and (not isinstance(self.count, int) or self.count < 1):
            raise UserError(f"count: expected a whole number >= 1, or None for all, got {self.count!r}")
        for field in fields(self):
            if isinstance(getattr(self, field.name), str):
                raise UserError(f"{field.name}: expected a list of patterns, got the text "
                                f"{getattr(self, field.name)!r:.60}")

    @property
    def whole(self) -> bool:
        """Whether nothing is left out."""
        return self == ExampleChoice()

    @property
    def by_index(self) -> bool:
        """Whether indexes are needed to tell which examples are wanted, or where their files are."""
        return self != ExampleChoice(split=self.split)

    def wants_split(self, name: str) -> bool:
        """Whether examples of a split may be wanted."""
        return _any(self.split, (name,))

    def asked(self) -> Asked:
        """What a dataset says of having been chosen from another; in one order, however it was asked."""
        given = {field.name: tuple(sorted(set(getattr(self, field.name)))) for field in fields(self)
                 if field.name != "count"}
        return Asked(**given, count=self.count or 0)


@dataclass(frozen=True, kw_only=True)
class ChosenShard:
    """Examples of one shard that are wanted."""

    shard: ShardRecord
    keys: tuple[str, ...]
    """In order; none where all are, with all layers: the shard is taken as it is."""
    bytes: int
    """Of their members that are wanted; of the whole shard where it is taken as it is."""

    @property
    def whole(self) -> bool:
        """Whether the shard is taken as it is."""
        return not self.keys


def layers_chosen(manifest: Manifest, choice: ExampleChoice) -> tuple[str, ...]:
    """Names of the layers that are wanted, in the manifest's order. Raises UserError where a pattern matches none."""
    names = [layer.name for layer in manifest.layers]
    _require(choice.layers, names, "layers")
    return tuple(name for name in names if _any(choice.layers, (name,)))


def choose(manifest: Manifest, choice: ExampleChoice,
           index_of: Callable[[ShardRecord], ShardIndex]) -> list[ChosenShard]:
    """The wanted examples, shard by shard; `index_of` is called where that cannot be told without, once each.

    Raises UserError where a pattern matches nothing, or all of them together do, naming what there is.
    """
    layers = layers_chosen(manifest, choice)
    _require(choice.split, [split.name for split in manifest.splits], "split")
    search, found = _Search(choice), list[ChosenShard]()
    left = {split.name: choice.count for split in manifest.splits}
    for shard in manifest.shards:
        if not choice.wants_split(shard.split):
            continue
        wanted = left[shard.split]
        # A pattern that has matched nothing yet may be misspelt
        if wanted == 0 and not search.unmatched:
            continue
        if not choice.by_index:
            found.append(ChosenShard(shard=shard, keys=(), bytes=shard.bytes))
            continue
        index = index_of(shard)
        matching = [example for example in index.examples if search.matches(example.facts)][:wanted]
        if wanted is not None:
            left[shard.split] = wanted - len(matching)
        if matching:
            found.append(_chosen(shard, index, matching, layers, len(manifest.layers)))
    search.require()
    if not found:
        raise UserError("expected a choice that chooses something: every pattern matches some examples, but no "
                        "example matches all that is asked")
    return found


def members_wanted(example: ExampleRecord, layers: Sequence[str]) -> list[int]:
    """Which members of an example are wanted: chosen layers, label and preview, in file order."""
    names = {f"{name}.exr" for name in layers}
    return [number for number, member in enumerate(example.members)
            if member.suffix in names or not member.suffix.endswith(".exr")]


class _Search:
    """Patterns about facts, and which of them have matched something."""

    def __init__(self, choice: ExampleChoice):
        self._asked = {name: getattr(choice, name) for name in FACTS if getattr(choice, name)}
        self._seen: dict[str, dict[str, None]] = {name: {} for name in self._asked}
        self.unmatched = {(name, pattern) for name, patterns in self._asked.items() for pattern in patterns}

    def matches(self, facts: ExampleFacts) -> bool:
        """Whether an example is wanted."""
        fits = True
        for name, patterns in self._asked.items():
            values = tuple(value for value in FACTS[name](facts) if value)
            if self.unmatched:
                self._seen[name] |= dict.fromkeys([" or ".join(values)])
                self.unmatched -= {(name, pattern) for pattern in patterns if _any((pattern,), values)}
            fits = fits and _any(patterns, values)
        return fits

    def require(self) -> None:
        """Raise UserError where a pattern matched nothing."""
        for name, pattern in sorted(self.unmatched):
            raise _nothing(name, pattern, list(self._seen[name]))


def _chosen(shard: ShardRecord, index: ShardIndex, matching: Sequence[ExampleRecord], layers: Sequence[str],
            known: int) -> ChosenShard:
    if len(matching) == len(index.examples) and len(layers) == known:
        return ChosenShard(shard=shard, keys=(), bytes=shard.bytes)
    wanted = {member.name: member.size for example in matching
              for member in (example.members[number] for number in members_wanted(example, layers))}
    return ChosenShard(shard=shard, keys=tuple(example.key for example in matching), bytes=sum(wanted.values()))


def _any(patterns: Iterable[str], values: Iterable[str]) -> bool:
    patterns = tuple(patterns)
    return not patterns or any(fnmatchcase(value, pattern) for value in values for pattern in patterns)


def _require(patterns: Iterable[str], names: Sequence[str], what: str) -> None:
    for pattern in patterns:
        if not _any((pattern,), names):
            raise _nothing(what, pattern, names)


def _nothing(what: str, pattern: str, names: Sequence[str]) -> UserError:
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return UserError(f"{what}: expected a name or pattern of what there is ({', '.join(names[:NAMED])}{more}), "
                     f"got {pattern!r:.60}")
