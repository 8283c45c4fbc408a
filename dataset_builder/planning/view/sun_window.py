"""A sun that is aimed at a window by name: from which side it shines, and whether it gets in."""

from math import atan2, degrees

import numpy as np

from dataset_builder.errors import PlanError, Problem
from dataset_builder.label.scene_plan import PortalPlan
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.cameras import towards
from dataset_builder.spec.problems import nearest, shown

GRID = 16
"""Rays through a window are GRID x GRID, evenly spread over it."""
WITHIN = 0.25
"""Metres behind the outer face of a window that light gets to if it gets in: further than a wall is thick."""
LEVEL = 1e-3
"""Horizontal part of a normal below which an opening is a skylight, which no azimuth faces."""


def faced(arrangement: Arrangement, name: str, key: str) -> float:
    """Azimuth that an opening faces, degrees; 0 of a skylight. Raises PlanError where the opening is not there."""
    outward = -_inward(_portal(arrangement, name, key))
    return degrees(atan2(outward[0], -outward[1])) if np.hypot(*outward[:2]) > LEVEL else 0.0


def require_entry(arrangement: Arrangement, name: str, azimuth: float, elevation: float, key: str) -> None:
    """Raise PlanError where a sun at an azimuth and elevation sends nothing in through an opening."""
    portal, way = _portal(arrangement, name, key), -towards(azimuth, elevation)
    where = f"at elevation {elevation:.3g} and azimuth {azimuth:.3g}"
    towards_room = float(way @ _inward(portal))
    if towards_room <= 0:
        raise _refused(key, f"expected a sun that shines on {name} from outside, got one {where}, behind its wall",
                       "azimuths between -90 and 90 are in front of the window: 0 faces it")
    steps = (np.indices((GRID, GRID)).reshape(2, -1).T + 0.5) / GRID
    points = np.asarray(portal.corner) + steps @ np.array([portal.right, portal.up])
    _, distance = arrangement.everything.first_hit(points, np.broadcast_to(way, points.shape))
    if not (distance * towards_room > WITHIN).any():
        raise _refused(key, f"expected a sun that gets in through {name}, got one {where}, whose light ends on the "
                       "frame, the wall or what stands before it", "lower the elevation, or turn the azimuth towards 0")


def _portal(arrangement: Arrangement, name: str, key: str) -> PortalPlan:
    found = arrangement.shell.openings((), arrangement.centre)
    if name in found.names:
        return found.portals[found.names.index(name)]
    raise _refused(key, f"expected the name of an opening of {arrangement.shell.name}, got {shown(name)}: "
                   + (f"there {'is' if len(found.names) == 1 else 'are'} {', '.join(found.names)}" if found.names else
                      found.why), nearest(name, found.names) if found.names else "leave `through` out")


def _inward(portal: PortalPlan) -> np.ndarray:
    """(3,) unit normal of a rectangle whose sides are to the right and upwards as they are seen from inside."""
    normal = np.cross(portal.right, portal.up)
    return np.asarray(normal / np.linalg.norm(normal))


def _refused(key: str, rule: str, hint: str) -> PlanError:
    return PlanError([Problem(where="", path=f"{key}.sun.through", rule=rule, hint=hint)])
