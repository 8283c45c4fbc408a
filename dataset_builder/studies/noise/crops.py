"""One case at every level in pictures: the light of its rough mesh, the predictions, and the truth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from dataset_builder.lightnet.data.loader import whole_images
from dataset_builder.lightnet.results.evaluate import Contender
from dataset_builder.lightnet.results.pictures import cropped, light
from dataset_builder.studies.noise.level_trainings import MIXED, HeldOut, contenders
from dataset_builder.studies.noise.levels import Level
from dataset_builder.studies.noise.noise_study import NoiseStudy, level_name

TRIVIAL = "dr_s_prime"
HEADINGS = {TRIVIAL: "(D + R) S', true D, R", MIXED: "trained on all levels", "own": "trained on this level"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Crop:
    """One case at one level. what: why it is shown; psnr: of every prediction, by its heading; panels: (H, W, 3) uint8
    pictures by heading, tone-mapped as metrics see them and cut to the object."""

    what: str
    key: str
    level: Level
    psnr: dict[str, float]
    panels: dict[str, np.ndarray]


def crops(study: NoiseStudy, split: HeldOut, levels: Sequence[Level]) -> Iterator[Crop]:
    """The median and the worst case at every level, by PSNR of the mixed training at the last one."""
    by_name = {one.name: one for one in contenders(study)}
    for what, case in chosen(split, levels).items():
        for level in levels:
            yield _crop(what, case, split, level, by_name)


def chosen(split: HeldOut, levels: Sequence[Level]) -> dict[str, int]:
    """Positions of the cases to show, by what they are; the worst one only where it is another."""
    ranked = sorted(range(len(split.cases)), key=lambda case: levels[-1].rows(MIXED)[case].metrics.psnr)
    middle, worst = ranked[len(ranked) // 2], ranked[0]
    return {"median": middle} | ({"worst": worst} if worst != middle else {})


def _crop(what: str, case: int, split: HeldOut, level: Level, by_name: dict[str, Contender]) -> Crop:
    example = split.of(level.number)[case]
    batch, = whole_images(split.dataset, [example.index])
    names = {TRIVIAL: TRIVIAL, MIXED: MIXED, "own": level_name(level.number)}
    panels = {"I_s": light(batch.inputs.i_s[0]), "S'": light(batch.inputs.s_prime[0])}
    for shown, name in names.items():
        one = by_name[name]
        panels[HEADINGS[shown]] = light(one.find(batch.to(one.device)).i_t[0])
    panels["truth"] = light((batch.truth.i_t * batch.inputs.inside)[0])
    return Crop(what=what, key=example.key, level=level, panels=cropped(panels, batch.inputs.inside[0]),
                psnr={HEADINGS[shown]: level.rows(name)[case].metrics.psnr for shown, name in names.items()})
