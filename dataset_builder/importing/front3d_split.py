"""The paper's split over a folder of scenes: which are for training, which for evaluation, and targets of each."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dataset_builder.importing.future_models import GROUPS, FutureModel, category_in, target_group
from dataset_builder.importing.scene_index import SceneIndex
from dataset_builder.seeding import rng

PAPER = {"train": (50, 30), "evaluation": (20, 10)}
"""Scenes and targets of each split (section 5.1.1 of the paper)."""
LEAST = 0.3
"""Metres; a target whose longest side is declared to be less is too small to be one."""
FLOOR = 0.1
"""Metres; what stands higher stands on something else, or hangs."""


@dataclass(frozen=True, kw_only=True)
class TargetChoice:
    """A model that is proposed as a target."""

    jid: str
    file: Path
    """Its OBJ file."""
    group: str
    """Of `GROUPS`."""
    category: str
    """Its word for specs."""
    told: str
    """Its category in 3D-FUTURE."""
    sizes: tuple[tuple[float, ...], ...]
    """What its scenes declare; the order of sides varies."""
    strange: bool
    """Whether it stands in no scene of another split."""
    scenes: int
    """Of how many of its own split's scenes it is furniture."""


Check = Callable[[TargetChoice], str]
"""Why a model cannot be a target, such as that its file cannot be read; "" where it can."""


@dataclass(frozen=True, kw_only=True)
class SplitChoice:
    """One split."""

    name: str
    scenes: tuple[SceneIndex, ...]
    targets: tuple[TargetChoice, ...]


@dataclass(frozen=True, kw_only=True)
class SplitProposal:
    """Both splits, or the one that there are scenes for."""

    splits: tuple[SplitChoice, ...]
    usable: int
    """Different scenes that could have been taken."""
    copies: tuple[tuple[str, str], ...]
    """Scenes that were passed over since another is the same, with that other."""
    shared: int
    """Models of furniture that stand in scenes of more than one split."""
    furniture: int
    """Models of furniture that stand in a scene of any split."""
    refused: Mapping[str, str] = field(default_factory=dict)
    """Models that were passed over as targets, and why."""


def propose_split(scenes: Sequence[SceneIndex], models: Mapping[str, FutureModel], *, seed: int,
                  check: Check = lambda choice: "") -> SplitProposal:
    """Scenes and targets for the paper's splits, disjoint both; in the paper's proportions where there are fewer.

    A target is furniture of its own split's scenes. Models that stand in a scene of the other split, too, are taken
    only where the others do not suffice: as furniture in its background, a target would have been seen in training.
    Groups of categories take turns. check: called with each target before it is taken.
    """
    different, copies = _different(scene for scene in scenes if not scene.unusable(models))
    order = [different[index] for index in rng(seed, "front3d", "scenes").permutation(len(different))]
    sizes = _shares(len(order), [count for count, _ in PAPER.values()])
    own, start = dict[str, tuple[SceneIndex, ...]](), 0
    for name, size in zip(PAPER, sizes, strict=True):
        if size:
            own[name] = tuple(sorted(order[start:start + size], key=lambda scene: scene.file))
        start += size
    standing = {name: Counter(jid for scene in taken for jid in set(scene.jids(models)))
                for name, taken in own.items()}
    targets, refused = _targets(own, standing, models, seed, check)
    seen = Counter(jid for counts in standing.values() for jid in counts)
    return SplitProposal(splits=tuple(SplitChoice(name=name, scenes=own[name], targets=targets[name]) for name in own),
                         usable=len(different), copies=copies, shared=sum(count > 1 for count in seen.values()),
                         furniture=len(seen), refused=refused)


def _different(scenes: Iterable[SceneIndex]) -> tuple[list[SceneIndex], tuple[tuple[str, str], ...]]:
    """Scenes of which none has the bytes or the uid of another, and the others with what they are copies of."""
    first, kept, copies = dict[str, str](), list[SceneIndex](), list[tuple[str, str]]()
    for scene in scenes:
        keys = [f"sha256 {scene.sha256}", *([f"uid {scene.uid}"] if scene.uid else [])]
        if same := next((first[key] for key in keys if key in first), None):
            copies.append((scene.file, same))
            continue
        kept.append(scene)
        first |= dict.fromkeys(keys, scene.file)
    return kept, tuple(copies)


def _shares(there: int, wanted: Sequence[int]) -> list[int]:
    """What is wanted, or shares of what is there in proportion; each at least 1 as long as there are enough.

    >>> _shares(100, (50, 20)), _shares(7, (50, 20)), _shares(2, (50, 20)), _shares(1, (50, 20))
    ([50, 20], [5, 2], [1, 1], [1, 0])
    """
    if there >= sum(wanted):
        return list(wanted)
    later = [max(1, there * count // sum(wanted)) for count in wanted[1:]] if there >= len(wanted) else [0]
    return [there - sum(later), *later]


def _targets(own: Mapping[str, Sequence[SceneIndex]], standing: Mapping[str, Mapping[str, int]],
             models: Mapping[str, FutureModel], seed: int,
             check: Check) -> tuple[dict[str, tuple[TargetChoice, ...]], dict[str, str]]:
    """Targets of each split, and models that were refused."""
    pools = {name: _pool(scenes, models, standing, name) for name, scenes in own.items()}
    distinct = {choice.jid for pool in pools.values() for choice in pool}
    wanted = dict(zip(PAPER, _shares(len(distinct), [count for _, count in PAPER.values()]), strict=True))
    taken, refused = set[str](), dict[str, str]()
    found: dict[str, list[TargetChoice]] = {name: [] for name in own}
    # The smaller split first: the larger one has more to choose from
    for name in sorted(pools, key=lambda name: wanted[name]):
        pool, most = pools[name], wanted[name] if len(own) > 1 else PAPER[name][1]
        order = [pool[index] for index in rng(seed, "front3d", "targets", name).permutation(len(pool))]
        for strange in (True, False):
            ranked = [choice for choice in order if choice.strange is strange]
            found[name] += _by_turns(ranked, most - len(found[name]), taken, refused, check)
    return {name: tuple(sorted(found[name], key=lambda choice: (choice.category, choice.jid))) for name in own}, refused


def _by_turns(ranked: Sequence[TargetChoice], wanted: int, taken: set[str], refused: dict[str, str],
              check: Check) -> list[TargetChoice]:
    """The first of each group that holds, then the second of each and so on, until there are as many as wanted."""
    queues = {group: [choice for choice in ranked if choice.group == group] for group in GROUPS}
    found = list[TargetChoice]()
    while len(found) < wanted and any(queues.values()):
        for queue in queues.values():
            while queue and len(found) < wanted:
                choice = queue.pop(0)
                if choice.jid in taken or choice.jid in refused:
                    continue
                if why := check(choice):
                    refused[choice.jid] = why
                    continue
                taken.add(choice.jid)
                found.append(choice)
                break
    return found


def _pool(scenes: Sequence[SceneIndex], models: Mapping[str, FutureModel], standing: Mapping[str, Mapping[str, int]],
          name: str) -> list[TargetChoice]:
    """Models that may be targets: furniture that stands on the floor of a room that can be used, in order of id."""
    told, sizes = dict[str, str](), dict[str, dict[tuple[float, ...], None]]()
    for piece in (piece for scene in scenes for room in scene.usable(models) for piece in room.pieces):
        if piece.valid and piece.jid in models and abs(piece.bottom) <= FLOOR:
            told.setdefault(piece.jid, category_in(models, piece.jid, piece.category))
            sizes.setdefault(piece.jid, {}).update(dict.fromkeys(piece.sizes))
    pool = list[TargetChoice]()
    for jid, category in sorted(told.items()):
        group, word = target_group(category)
        if group and max(map(max, sizes[jid]), default=LEAST) >= LEAST:
            strange = not any(jid in counts for other, counts in standing.items() if other != name)
            pool.append(TargetChoice(jid=jid, file=models[jid].file, group=group, category=word, told=category,
                                     sizes=tuple(sizes[jid]), strange=strange, scenes=standing[name][jid]))
    return pool
