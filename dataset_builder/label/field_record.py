"""What is known of a field that an object is seen through: how it was made, and how well it shows what it was fitted
to."""

from typing import Literal

from dataset_builder.spec.model import Model


class FieldRecord(Model):
    """Figures of one field, the same in every example that is seen through it."""

    key: str
    """Digest of all that it was made from, or of its file where it was imported."""
    kind: Literal["density", "sdf", "splats"]
    """`density`: volume density (NeRF); `sdf`: signed distance (NeuS); `splats`: Gaussian splats."""
    truth: bool
    """Whether there is a clean mesh to compare with; captures have none."""
    masked: bool = True
    """Whether these images had masks; without, what stood behind the object within the field's ball is part of it."""
    views: int
    """Images that it was fitted to; 0 for splats, which were fitted elsewhere."""
    held_out: int
    """Images that it was measured on and not fitted to."""
    width: int
    """Of the images, pixels."""
    resolution: int
    """Cells along a side of its grid; 0 for splats."""
    psnr: float
    """dB over held-out images inside of their masks, divided by the radiance of white paper, sRGB-encoded and cut off
    at 1, mean over images; 0 where none were held out."""
    psnr_worst: float
    """Of the worst of these images."""
    ssim: float
    """Structural similarity of held-out images on black, sRGB-encoded, mean; 0 where none were held out."""
    opacity_iou: float
    """Intersection over union of opacity and mask over held-out images, sum of minima over sum of maxima."""
    silhouette_iou: float
    """The same of the mesh's silhouette and the masks of the images that it was fitted to."""
    level: float
    """Opacity of one cell at which the mesh was taken; 0 for a signed distance and for splats."""
    bodies: int
    """Connected parts of the mesh."""
    bodies_dropped: int
    """Smaller parts that were taken away."""
    depth_95: float
    """95th percentile over held-out images of |depth of the mesh - depth of the clean mesh| where both are seen, in
    bounding radii; 0 without a clean mesh."""
    loss: float
    """Of the last steps of the fit, mean; 0 for splats."""
