"""What target lights are planned for: one view, or all views of a pair that are lit the same."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

import numpy as np

from dataset_builder.label.scene_plan import CameraPlan
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.cameras import PlannedCamera
from dataset_builder.planning.view.daylight import sky_share
from dataset_builder.planning.view.visibility import Sight
from dataset_builder.spread import spaced

LIT_SHARE, LIT_AROUND = 0.5, 0.25
"""Least share of the visible points that must get direct light from a target light: of those of one view, and of those
of several, for a lamp lights one side of what they see from all sides."""
POINTS = 2048
"""Points that several views together are judged by, about."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LitView:
    """What target lights are planned for."""

    arrangement: Arrangement
    cameras: Sequence[CameraPlan]
    """One or more, in whose way no light may be."""
    sight: Sight
    """What they see."""
    unit: float
    """The source's irradiance."""
    sky: float
    """Share of a dome's irradiance that arrives, see `sky_share`."""

    @property
    def least_lit(self) -> float:
        """Least share of the visible points that must get direct light."""
        return LIT_SHARE if len(self.cameras) == 1 else LIT_AROUND


def lit_view(arrangement: Arrangement, views: Sequence[PlannedCamera], unit: float) -> LitView:
    """The views as one. unit: the source's irradiance."""
    sight = views[0].sight if len(views) == 1 else together([view.sight for view in views])
    return LitView(arrangement=arrangement, cameras=[view.camera for view in views], sight=sight, unit=unit,
                   sky=sky_share(arrangement, sight))


def together(sights: Sequence[Sight]) -> Sight:
    """What several frames show of the target: means, and as many points of each as of any other, where it has them."""
    most = max(POINTS // len(sights), 1)
    picks = [spaced(len(sight.points), most) for sight in sights]
    return Sight(**{name: fmean(getattr(sight, name) for sight in sights)
                    for name in ("coverage", "solid", "visibility", "framed")},
                 points=np.concatenate([sight.points[pick] for sight, pick in zip(sights, picks, strict=True)]),
                 normals=np.concatenate([sight.normals[pick] for sight, pick in zip(sights, picks, strict=True)]))
