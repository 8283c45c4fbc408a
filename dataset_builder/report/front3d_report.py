"""What `import front3d` found: how much of a folder can be used, what is wrong with it, and what is proposed."""

from collections import Counter
from collections.abc import Iterable

from rich.table import Table

from dataset_builder.files import size_text
from dataset_builder.importing.front3d_import import Front3dImported, fault_counts
from dataset_builder.importing.front3d_split import PAPER, SplitChoice, SplitProposal
from dataset_builder.importing.scene_index import SceneIndex
from dataset_builder.report.console import cell

SHOWN = 5
"""Files that are named of those that cannot be read; the tables name all."""


def usable_table(done: Front3dImported) -> Table:
    """How many scenes and rooms can be used, and why others cannot."""
    scenes = Counter(scene.unusable(done.models) for scene in done.index.scenes)
    rooms = Counter(room.unusable(done.models) for scene in done.index.scenes for room in scene.rooms)
    table = Table("", "scenes", "rooms", title="What can be used", title_justify="left")
    for reason in sorted(scenes.keys() | rooms.keys(), key=lambda reason: (bool(reason), -scenes[reason], reason)):
        table.add_row(cell(reason or "can be used"), f"{scenes[reason]:,}", f"{rooms[reason]:,}")
    table.add_row("all", f"{scenes.total():,}", f"{rooms.total():,}")
    return table


def fault_table(scenes: Iterable[SceneIndex]) -> Table:
    """Kinds of faults of all scenes."""
    table = Table("fault, and what became of it", "scenes", "times", title="Faults", title_justify="left")
    for kind, having, times in fault_counts(scenes):
        table.add_row(cell(kind), f"{having:,}", f"{times:,}")
    return table


def front3d_lines(done: Front3dImported, *, seconds: float, models_named: bool) -> list[str]:
    """What was read and how fast, what was passed over, and what is proposed."""
    index, broken = done.index, [scene for scene in done.index.scenes if scene.broken]
    kept = len(index.scenes) - index.read
    # Files that the index holds take time, too, to see that their bytes are the same
    rate = (f", {index.read / seconds:,.1f} files/s, {size_text(index.read_bytes / seconds)}/s"
            if seconds > 0 and not kept else "")
    lines = [f"{index.read:,} scenes read ({size_text(index.read_bytes)} in {seconds:,.1f} s{rate})"
             + f", {kept:,} taken from the index" * bool(kept)]
    lines += [f"cannot be read: {scene.file}: {scene.broken}" for scene in broken[:SHOWN]]
    if len(broken) > SHOWN:
        lines.append(f"cannot be read: {len(broken) - SHOWN:,} more, see scenes.csv")
    if not models_named:
        lines.append("no folder of models was named, so that all furniture counts as unpublished: give --models")
    lines += _split_lines(done.proposal)
    if done.dataset is None:
        lines.append("no dataset is proposed: "
                     + ("no target can be found among the furniture" if done.proposal.splits
                        else "there is no scene that can be used"))
    return lines


def _split_lines(proposal: SplitProposal) -> list[str]:
    lines = []
    if proposal.copies:
        lines.append(f"{len(proposal.copies):,} scenes passed over, copies of others: "
                     + ", ".join(f"{one} of {other}" for one, other in proposal.copies[:SHOWN])
                     + ", ..." * (len(proposal.copies) > SHOWN))
    lines += [_split_line(split) for split in proposal.splits]
    if len(proposal.splits) > 1:
        lines.append("splits share no scene and no target; of the "
                     f"{proposal.furniture:,} models that stand in their scenes, {proposal.shared:,} stand in both")
    if proposal.refused:
        lines.append(f"{len(proposal.refused):,} models passed over as targets: "
                     + "; ".join(f"{jid}: {why}" for jid, why in [*proposal.refused.items()][:SHOWN])
                     + "; ..." * (len(proposal.refused) > SHOWN))
    return lines


def _split_line(split: SplitChoice) -> str:
    scenes, targets = PAPER[split.name]
    groups = Counter(target.group for target in split.targets)
    seen = sum(not target.strange for target in split.targets)
    return (f"{split.name}: {len(split.scenes)}{_of(len(split.scenes), scenes)} scenes, "
            f"{len(split.targets)}{_of(len(split.targets), targets)} targets ("
            + ", ".join(f"{count} {group}" for group, count in sorted(groups.items())) + ")"
            + f"; {seen} of them also stand in scenes of the other split" * bool(seen))


def _of(there: int, wanted: int) -> str:
    return "" if there == wanted else f" of {wanted}"
