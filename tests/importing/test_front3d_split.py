"""The paper's split: disjoint, in proportion, balanced, and the same whatever the order of draws before."""

import doctest
from collections import Counter
from pathlib import Path

import pytest

from dataset_builder.importing import front3d_split, future_models
from dataset_builder.importing.front3d_split import PAPER, SplitProposal, TargetChoice, propose_split
from dataset_builder.importing.future_models import GROUPS, FutureModel
from dataset_builder.importing.scene_index import (
    BROKEN,
    EMPTY,
    NO_FLOOR,
    SMALL,
    UNPUBLISHED,
    FurniturePiece,
    RoomIndex,
    SceneIndex,
)

CATEGORIES = ("Dining Chair", "Loveseat Sofa", "Coffee Table", "Wardrobe", "King-size Bed", "Barstool", "Floor Lamp")
"""One of each group, in order."""
POPULAR = 7
"""Models that stand in every scene, one of each category."""


def model(number: int) -> str:
    return f"m{number:04d}"


def models(count: int) -> dict[str, FutureModel]:
    return {model(n): FutureModel(jid=model(n), file=Path(model(n), "raw_model.obj"),
                                  category=CATEGORIES[n % len(CATEGORIES)]) for n in range(count)}


def scene(number: int, *jids: str, **changes: object) -> SceneIndex:
    pieces = tuple(FurniturePiece(jid=jid, sizes=((0.5, 0.6, 0.9),)) for jid in jids)
    given = {"file": f"{number:04d}.json", "sha256": f"{number:064x}", "size": 1, "uid": f"u{number}",
             "rooms": (RoomIndex(name="Bedroom-1", kind="Bedroom", area=12.0, pieces=pieces),), **changes}
    return SceneIndex(**given)  # type: ignore[arg-type]


def folder(count: int, own: int = 7) -> list[SceneIndex]:
    """Scenes with the popular models and a few of their own each."""
    return [scene(n, *map(model, [*range(POPULAR), *range(POPULAR + own * n, POPULAR + own * (n + 1))]))
            for n in range(count)]


def jids(split: front3d_split.SplitChoice) -> set[str]:
    return {target.jid for target in split.targets}


def test_examples_of_the_docstrings() -> None:
    assert doctest.testmod(front3d_split).failed == doctest.testmod(future_models).failed == 0


def test_the_papers_numbers_and_nothing_in_common() -> None:
    scenes, there = folder(120), models(7 + 7 * 120)
    proposal = propose_split(scenes, there, seed=0)
    train, evaluation = proposal.splits
    assert [(len(split.scenes), len(split.targets)) for split in proposal.splits] == [*PAPER.values()]
    assert not {one.file for one in train.scenes} & {one.file for one in evaluation.scenes}
    assert not jids(train) & jids(evaluation)
    for split, other in ((train, evaluation), (evaluation, train)):
        furniture = {jid for one in other.scenes for jid in one.jids(there)}
        assert not jids(split) & furniture and all(target.strange for target in split.targets)
        assert jids(split) <= {jid for one in split.scenes for jid in one.jids(there)}
        counts = Counter(target.group for target in split.targets)
        assert counts.keys() == GROUPS.keys() and max(counts.values()) - min(counts.values()) <= 1
    assert (proposal.shared, proposal.furniture, proposal.usable) == (POPULAR, POPULAR + 7 * 70, 120)


@pytest.mark.parametrize(("count", "wanted"), [(69, [50, 19]), (14, [10, 4]), (2, [1, 1]), (1, [1])])
def test_fewer_scenes_are_shared_out_in_proportion(count: int, wanted: list[int]) -> None:
    proposal = propose_split(folder(count), models(7 + 7 * count), seed=3)
    assert [len(split.scenes) for split in proposal.splits] == wanted
    assert all(split.targets for split in proposal.splits)


def test_models_that_stand_everywhere_are_shared_out_where_there_are_no_others() -> None:
    proposal = propose_split(folder(10, own=0), models(POPULAR), seed=0)
    train, evaluation = proposal.splits
    assert (len(train.targets), len(evaluation.targets)) == (6, 1)
    assert not jids(train) & jids(evaluation)
    assert not any(target.strange for split in proposal.splits for target in split.targets)


def test_a_seed_is_a_split() -> None:
    def drawn(seed: int) -> tuple[SplitProposal, list[str]]:
        scenes = folder(100)
        proposal = propose_split(scenes, models(800), seed=seed)
        return proposal, [one.file for one in proposal.splits[0].scenes]

    assert drawn(1) == drawn(1)
    assert drawn(1)[1] != drawn(2)[1]


def test_copies_are_taken_once() -> None:
    """A scene under another name, and one that was saved again under its uid."""
    scenes = [scene(0, model(0)), scene(1, model(0), sha256=f"{0:064x}"), scene(2, model(0), uid="u0"),
              scene(3, model(1), uid=""), scene(4, model(1), uid="")]
    proposal = propose_split(scenes, models(7), seed=0)
    assert proposal.copies == (("0001.json", "0000.json"), ("0002.json", "0000.json"))
    assert sorted(one.file for split in proposal.splits for one in split.scenes) == ["0000.json", "0003.json",
                                                                                     "0004.json"]


def test_what_makes_no_target() -> None:
    """Small, hanging, on a table, of no known category, not published, in a room that is too small, refused."""
    def piece(jid: str, **changes: object) -> FurniturePiece:
        return FurniturePiece(**{"jid": jid, "sizes": ((0.5, 0.5, 0.5),), **changes})  # type: ignore[arg-type]

    there = models(21) | {"lamp": FutureModel(jid="lamp", file=Path("lamp"), category="pendant lamp"),
                          "rug": FutureModel(jid="rug", file=Path("rug"), category="others")}
    closet = RoomIndex(name="Closet-2", kind="Closet", area=2.0, pieces=(piece(model(5)),))
    room = RoomIndex(name="Bedroom-1", kind="Bedroom", area=9.0, pieces=(
        piece(model(0), sizes=((0.2, 0.1, 0.1),)), piece(model(1), bottom=0.75), piece("lamp"), piece("rug"),
        piece(model(2), valid=False), piece("gone"), piece(model(3), sizes=()), piece(model(4)), piece(model(6))))
    asked = list[str]()

    def check(choice: TargetChoice) -> str:
        asked.append(choice.jid)
        return "cannot be read" if choice.jid == model(4) else ""

    proposal = propose_split([scene(0, rooms=(closet, room))], there, seed=0, check=check)
    assert jids(proposal.splits[0]) == {model(3), model(6)} and proposal.refused == {model(4): "cannot be read"}
    assert sorted(asked) == [model(3), model(4), model(6)]


def test_why_a_scene_cannot_be_used() -> None:
    there = models(3)
    rooms = {reason: RoomIndex(name=reason, kind="", area=area, pieces=pieces) for reason, area, pieces in (
        (NO_FLOOR, 0.0, (FurniturePiece(jid=model(0)),)), (SMALL, 3.9, (FurniturePiece(jid=model(0)),)),
        (EMPTY, 9.0, ()), (UNPUBLISHED, 9.0, (FurniturePiece(jid="gone"), FurniturePiece(jid=model(1), valid=False))),
        ("", 4.0, (FurniturePiece(jid=model(0)),)))}
    for reason, room in rooms.items():
        assert room.unusable(there) == reason
        assert scene(0, rooms=(room,)).unusable(there) == reason
    assert scene(0, rooms=(rooms[""], rooms[NO_FLOOR])).unusable(there) == ""
    assert scene(0, rooms=(rooms[UNPUBLISHED], rooms[SMALL])).unusable(there) == UNPUBLISHED
    assert scene(0, rooms=()).unusable(there) == NO_FLOOR
    assert scene(0, rooms=(rooms[""],), broken="no JSON").unusable(there) == BROKEN
    assert scene(0, rooms=(rooms[UNPUBLISHED],)).missing(there) == ["gone"]
    assert rooms[""].unusable({}) == UNPUBLISHED
