"""Which bodies of glass overlap, and when nobody has said who owns what they share."""

from dataclasses import replace

import numpy as np
import pytest

from dataset_builder.assets.asset import Asset, Material
from dataset_builder.geometry.mesh import TriangleMesh
from dataset_builder.planning.effects.nested_glass import unowned_glass

HERE = np.eye(4)


def glass(name, priority=0, ior=1.5):
    return Material(name=name, base_color=(1, 1, 1), roughness=0.0, transmission=1.0, ior=ior, priority=priority)


def cubes(*halves, materials, at=None):
    """An asset of cubes about points, one material each; a negative half is a cavity."""
    corner = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], float)
    quads = np.array([(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    centres = np.zeros((len(halves), 3)) if at is None else np.asarray(at, float)
    names = list(dict.fromkeys(materials))
    mesh = TriangleMesh(
        positions=np.concatenate([abs(half) * corner + centre for half, centre in zip(halves, centres, strict=True)]),
        faces=np.concatenate([8 * k + (faces if half > 0 else faces[:, ::-1]) for k, half in enumerate(halves)]),
        uvs=np.zeros((12 * len(halves), 3, 2)),
        material=np.repeat([names.index(material) for material in materials], 12))
    return Asset(name="thing", category="vase", mesh=mesh, materials=tuple(names))


BOTTLE, WATER = glass("bottle"), glass("water", ior=1.33)


def unowned(*halves, materials, at=None):
    return unowned_glass([("thing", cubes(*halves, materials=materials, at=at), HERE)])


@pytest.mark.parametrize("half", [0.9, 0.8, 0.2])
def test_liquid_in_glass_without_an_owner_is_named(half):
    """Overlapping the wall of a bottle and touching it; and ice in water, which lies in it as a whole."""
    shell = (1.0, -0.8) if half > 0.5 else (1.0,)
    found = unowned(*shell, half, materials=(*[BOTTLE] * len(shell), WATER))
    assert found == ("bottle of thing and water of thing",)


def test_what_has_an_owner_or_does_not_touch_is_not_named():
    filled = (1.0, -0.8, 0.9)
    owners = replace(BOTTLE, priority=2), replace(WATER, priority=1)
    assert unowned(*filled, materials=(owners[0], owners[0], owners[1])) == ()
    assert unowned(1.0, -0.8, 0.6, materials=(BOTTLE, BOTTLE, WATER)) == ()          # A gap of air
    assert unowned(1.0, -0.8, materials=(BOTTLE, BOTTLE)) == ()
    assert unowned(1.0, 0.5, materials=(BOTTLE, WATER), at=[(0, 0, 0), (3, 0, 0)]) == ()
    assert unowned(1.0, 0.5, materials=(BOTTLE, Material(name="stone", base_color=(1, 1, 1)))) == ()


def test_one_priority_for_two_kinds_of_glass_owns_nothing_and_for_one_kind_all():
    alike = replace(BOTTLE, priority=1), replace(WATER, priority=1)
    assert unowned(1.0, 0.5, materials=alike) == ("bottle of thing and water of thing",)
    assert unowned(1.0, 0.9, materials=(BOTTLE, BOTTLE), at=[(0, 0, 0), (1, 0, 0)]) == ("bottle of thing in itself",)
    assert unowned(1.0, 0.9, materials=(alike[0],) * 2, at=[(0, 0, 0), (1, 0, 0)]) == ()


def test_things_meet_where_they_stand_and_mirrors_turn_nothing_inside_out():
    bottle, water = cubes(1.0, -0.8, materials=(BOTTLE, BOTTLE)), cubes(0.9, materials=(WATER,))
    mirror, far = np.diag([-1.0, 1, 1, 1]), np.eye(4)
    far[0, 3] = 5.0
    named = ("bottle of a and water of b",)
    assert unowned_glass([("a", bottle, HERE), ("b", water, HERE)]) == named
    assert unowned_glass([("a", bottle, mirror), ("b", water, mirror)]) == named
    assert unowned_glass([("a", bottle, HERE), ("b", water, far)]) == ()
