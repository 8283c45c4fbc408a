"""The path that the views of a pair are on, of whatever kind."""

from dataset_builder.planning.catalogue import PairRef
from dataset_builder.planning.scene.arrangement import Arrangement
from dataset_builder.planning.view.orbit import plan_orbit
from dataset_builder.planning.view.poses import plan_poses, read_poses
from dataset_builder.planning.view.spline import plan_spline
from dataset_builder.planning.view.turntable import plan_turntable
from dataset_builder.planning.view.view_path import ViewPath
from dataset_builder.seeding import rng
from dataset_builder.spec.camera_path import OrbitSpec, SplineSpec, TurntableSpec
from dataset_builder.spec.document import Path as KeyPath
from dataset_builder.spec.resolve import LoadedSpec


def plan_path(loaded: LoadedSpec, pair: PairRef, arrangement: Arrangement, where: str) -> ViewPath:
    """The path of a pair whose camera has one. arrangement: the target as it was placed.

    Raises PlanError, naming `where` or the line of the spec, where a whole path cannot be had.
    """
    spec = loaded.dataset
    camera, views, path = spec.camera_of(pair.split), spec.split_of(pair.split).views, spec.camera_of(pair.split).path
    assert path is not None
    draws = rng(spec.seed, *pair.path, path.kind)
    if isinstance(path, OrbitSpec):
        return plan_orbit(arrangement, path, camera, spec.image, views, draws)
    if isinstance(path, TurntableSpec):
        return plan_turntable(arrangement, path, camera, spec.image, views, draws, loaded.path.parent)
    if isinstance(path, SplineSpec):
        return plan_spline(arrangement, path, camera, spec.image, views, draws, where)
    found = read_poses(loaded, path, _place(loaded, pair.split), views)
    return plan_poses(arrangement, path, found, spec.image, views)


def _place(loaded: LoadedSpec, split: str) -> KeyPath:
    """Where the path of a split is written in the dataset file."""
    for number, each in enumerate(loaded.dataset.splits):
        if each.name == split and each.camera is not None:
            return "splits", number, "camera", "path"
    return "camera", "path"
