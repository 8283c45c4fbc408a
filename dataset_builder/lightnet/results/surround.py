"""What a predicted object is put into: the frame about it, whatever the frame shows in its place.

Without more than a frame with something in the object's place, that frame is all there is, and at the rim what it shows
there shines through 1 - M. With the frame without the object, `empty`, what is behind the rim is known, and the frame
with the object says its shadow, frame - empty: negative where it takes light, positive where it throws some back. The
shadow is known where neither mask has a share; in the rim it is filled from there, see `results.inpaint`.
"""

import numpy as np

from dataset_builder.errors import Problem, UserError
from dataset_builder.lightnet.results.compose_input import ComposeInput
from dataset_builder.lightnet.results.inpaint import fill


def surround(frame: ComposeInput, *, shadow: bool = True) -> np.ndarray:
    """(H, W, 3) scene-referred light about the object; where M is 1 it does not matter. shadow: whether the object
    throws one, where the frame says which.

    Raises UserError where no shadow is asked for and the frame has no picture without the object.
    """
    if frame.empty is None:
        if not shadow:
            raise UserError([Problem(where=frame.name, path="", hint="build with --set layers.i_t_empty=frame, or give "
                                     "--empty", rule="expected the scene without the object to leave its shadow out, "
                                                     "got none")])
        return _given(frame)
    if frame.background is None or not shadow:
        return frame.empty
    covered = np.any(frame.mask, axis=-1)
    if frame.mask_rough is not None:
        covered = covered | np.any(frame.mask_rough, axis=-1)
    if covered.all():
        return frame.empty
    thrown = fill(frame.background - frame.empty, ~covered, covered & (frame.mask[..., 0] < 1))
    about = np.maximum(frame.empty + thrown, 0)
    return np.where(covered[..., None], about, frame.background).astype(np.float32)


def _given(frame: ComposeInput) -> np.ndarray:
    assert frame.background is not None, "inputs have one of the two"
    return frame.background
