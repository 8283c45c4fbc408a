"""Light paths of two scenes that differ in one object, put side by side.

The same random numbers give the same vertices until a path meets the object. A link takes its candidates by their place
in a table, so that one vertex more or less would give every link another one, and both pictures noise of their own.
Therefore each scene's table has the other's vertices too, but dark ones, which are never chosen: places are the same,
and where the object changes nothing, so is what is found. Candidates that are dark cost a little noise.
"""

from dataclasses import replace

import numpy as np

from dataset_builder.rendering.transport.light_paths import BRIGHT, EDGES, FLUX, LightVertices


def beside(own: LightVertices, other: LightVertices) -> LightVertices:
    """The vertices of a scene and those that only the other scene has, dark, in an order that is the same whichever of
    the two is whose. Both have the same sets of paths."""
    values, path = np.concatenate([own.values, other.values]), np.concatenate([own.path, other.path])
    prim = np.concatenate([own.prim, np.zeros_like(other.prim)])
    theirs = np.arange(len(values)) >= len(own.values)
    values[theirs, BRIGHT], values[theirs, FLUX] = 0, 0
    keys = (path, values[:, EDGES], *values[:, :3].T)
    order = np.lexsort((theirs, *keys[::-1]))
    again = np.ones(len(order), dtype=bool)
    for key in keys:
        again[1:] &= key[order][1:] == key[order][:-1]
    again[:1] = False
    order = order[~(again & theirs[order])]
    return replace(own, values=values[order], prim=prim[order], path=path[order])
