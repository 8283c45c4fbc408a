"""Whether a surface has no hole: what refining, mending and roughening must keep."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from dataset_builder.geometry.edges import Edges


def watertight(edges: Edges) -> bool:
    """True for a closed, consistently oriented surface: every edge is passed as often forwards as backwards."""
    forward = np.bincount(edges.of_face.ravel(), weights=edges.forward.ravel(), minlength=len(edges.vertices))
    return bool((2 * forward == edges.face_count).all())


def boundary_loops(edges: Edges) -> int:
    """How many curves of edges with a single face there are."""
    pairs = edges.vertices[edges.face_count == 1]
    vertices, ends = np.unique(pairs, return_inverse=True)
    ends = ends.reshape(-1, 2)
    graph = coo_array((np.ones(len(ends), bool), (ends[:, 0], ends[:, 1])), shape=(len(vertices),) * 2)
    return int(connected_components(graph, directed=False)[0]) if len(ends) else 0
