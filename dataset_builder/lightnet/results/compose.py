"""A predicted object put back into its scene: I_R = I_PBR (1 - M) + M I_t, in linear, scene-referred light.

I_PBR is a frame of the whole scene, with the rough mesh or whatever else stands in the object's place: what M covers of
it does not matter, its shadows on the rest do, and what shows of it at the rim is made good where the scene is known
without it, see `surround`. I_t is the prediction divided by the exposure that it was made at; where
a network says light below 0, it is 0.

A prediction covers M but for its rim: pixels of which the object has too small a share to count as inside, and pixels
where the rough mesh is not, so that S' has no light of it. Those are filled from the predicted pixels beside them, in
display values (`lightnet.results.inpaint`). The paper fills them by a network, EdgeConnect.
"""

from dataclasses import dataclass

import numpy as np
import torch

from dataset_builder.errors import Problem, UserError
from dataset_builder.lightnet.data.assemble import ExamplePart, planes_of, whole
from dataset_builder.lightnet.data.batch import Batch
from dataset_builder.lightnet.data.lighting_dataset import exposure_of
from dataset_builder.lightnet.data.ranges import linear_light, tone_map
from dataset_builder.lightnet.methods.checkpoint import Trained
from dataset_builder.lightnet.methods.method import predict
from dataset_builder.lightnet.results.compose_input import ComposeInput
from dataset_builder.lightnet.results.inpaint import fill
from dataset_builder.lightnet.results.pictures import light
from dataset_builder.lightnet.results.surround import surround

NEEDS_SH = ("dpr", "ssvbrdf")
"""Methods that are told the scene's light as spherical harmonics."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Composite:
    """A composed frame."""

    picture: np.ndarray
    """(H, W, 3) scene-referred light."""
    background: np.ndarray
    """(H, W, 3) likewise, what the object was put into."""
    i_t: np.ndarray
    """(H, W, 3) likewise, the object alone, rim filled, 0 elsewhere."""
    predicted: np.ndarray
    """(H, W) bool, pixels whose I_t the method said."""
    filled: np.ndarray
    """(H, W) bool, pixels whose I_t comes from their neighbours."""
    exposure: float
    """Factor to network range, and of the pictures for people."""


def compose(trained: Trained, frame: ComposeInput, *, shadow: bool = True) -> Composite:
    """Predict the object of a frame and put it into what `surround` says is about it.

    Raises UserError where the method needs what the frame has not, where M has no pixel inside, where the rough mesh is
    nowhere inside M, and as `surround` does.
    """
    background = surround(frame, shadow=shadow)
    data = trained.spec.data
    if trained.name in NEEDS_SH and frame.lighting is None:
        raise _wrong(frame, f"expected a method that uses S', got {trained.name}, which needs the scene's light as "
                            "spherical harmonics", "use an example of a dataset, or a checkpoint of lightnet")
    inside, covered = frame.mask[..., 0] >= data.inside, _covered(frame)
    if not inside.any():
        raise _wrong(frame, f"expected a mask with a pixel >= {data.inside:g}, got at most {frame.mask.max():g}")
    if not (inside & covered).any():
        raise _wrong(frame, "expected the rough mesh inside the mask, got none",
                     "S' and the mask must have the same camera")
    batch = seen(frame, inside, source_exposure=data.source_exposure).to(trained.device)
    predicted, exposure = _numpy(predict(trained.method, batch.inputs).i_t[0]).clip(min=0), float(batch.exposure[0])
    known, wanted = inside & covered, frame.mask[..., 0] > 0
    exposed = with_rim(predicted, known, wanted & ~known)
    i_t = np.where(wanted[..., None], exposed / np.float32(exposure), np.float32(0))
    return Composite(picture=blend(background, i_t, frame.mask), background=background, i_t=i_t, predicted=known,
                     filled=wanted & ~known, exposure=exposure)


def blend(background: np.ndarray, i_t: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(H, W, 3) background (1 - mask) + mask i_t; each of the two bit by bit where the mask is 0 or 1."""
    mixed = background * (1 - mask) + mask * i_t
    return np.where(mask == 0, background, np.where(mask == 1, i_t, mixed)).astype(np.float32)


def with_rim(exposed: np.ndarray, known: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """(H, W, 3) exposed light with the asked (H, W) pixels filled from the known ones; all others bit by bit."""
    display = _numpy(tone_map(_tensor(exposed)))
    filled = _numpy(linear_light(_tensor(fill(display, known, asked))))
    return np.where(asked[..., None], filled, exposed)


def seen(frame: ComposeInput, inside: np.ndarray, *, source_exposure: float) -> Batch:
    """A frame as examples of a dataset are seen, a batch of one; its truth is 0. Light below 0 counts as 0."""
    nothing, s_prime = np.zeros_like(frame.i_s), frame.s_prime.clip(min=0)
    pictures = {"i_s": frame.i_s.clip(min=0), "s_prime": s_prime, "d": nothing, "r": nothing, "i_t": nothing}
    return whole(ExamplePart(
        key=frame.name, layers=[(name, planes_of(picture)) for name, picture in pictures.items()], inside=inside,
        exposure=exposure_of(planes_of(s_prime), inside), source_exposure=source_exposure,
        lighting=np.zeros((3, 9)) if frame.lighting is None else frame.lighting))


def panels(frame: ComposeInput, composite: Composite) -> dict[str, np.ndarray]:
    """(H, W, 3) uint8 pictures by heading: what goes in, what comes out, mapped as networks see them."""
    mask = frame.mask
    shown = {"I_s M": frame.i_s * mask, "S' M": frame.s_prime * composite.exposure * mask,
             "I_t": composite.i_t * composite.exposure * mask, "I_PBR": composite.background * composite.exposure,
             "I_R": composite.picture * composite.exposure}
    return {heading: light(_tensor(linear.astype(np.float32))) for heading, linear in shown.items()}


def _covered(frame: ComposeInput) -> np.ndarray:
    """(H, W) where S' has light of the rough mesh; without its mask, where S' has light at all."""
    return np.any(frame.s_prime if frame.mask_rough is None else frame.mask_rough, axis=-1)


def _tensor(picture: np.ndarray) -> torch.Tensor:
    """(C, H, W) of (H, W, C)."""
    return torch.from_numpy(np.ascontiguousarray(picture.transpose(2, 0, 1)))


def _numpy(picture: torch.Tensor) -> np.ndarray:
    """(H, W, C) of (C, H, W)."""
    return np.ascontiguousarray(picture.cpu().numpy().transpose(1, 2, 0))


def _wrong(frame: ComposeInput, rule: str, hint: str = "") -> UserError:
    return UserError([Problem(where=frame.name, path="", rule=rule, hint=hint)])
