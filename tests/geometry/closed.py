"""Whether a surface has no hole: what refining, mending and roughening must keep."""

import numpy as np

from dataset_builder.geometry.edges import Edges


def watertight(edges: Edges) -> bool:
    """True for a closed, consistently oriented surface: every edge is passed as often forwards as backwards."""
    forward = np.bincount(edges.of_face.ravel(), weights=edges.forward.ravel(), minlength=len(edges.vertices))
    return bool((2 * forward == edges.face_count).all())
