"""How rough the R3DM of an example came out, measured against its 3DM; `geometry/roughness.py` measures it."""

from dataset_builder.spec.model import Model


class ShapeRoughness(Model):
    """What is measured on the meshes."""

    to_clean_rms: float
    """Distance from points on the R3DM to the 3DM, root mean square, in bounding radii."""
    to_clean_95: float
    """95th percentile of that distance, in bounding radii."""
    to_rough_rms: float
    """Distance from points on the 3DM to the R3DM, root mean square, in bounding radii."""
    to_rough_95: float
    """95th percentile of that distance, in bounding radii."""
    normal_median: float
    """Angle between the normals of both at points on the R3DM, median, degrees."""
    normal_95: float
    """95th percentile of that angle, degrees."""
    volume: float
    """Ratio R3DM : 3DM of the volume; 0 where the 3DM is not closed or encloses nothing."""
    area: float
    """Ratio R3DM : 3DM of the area."""
    extent_x: float
    """Ratio R3DM : 3DM of the extent along the object's x; 0 where the 3DM has none."""
    extent_y: float
    """Ratio R3DM : 3DM of the extent along the object's y; 0 where the 3DM has none."""
    extent_z: float
    """Ratio R3DM : 3DM of the extent along the object's z; 0 where the 3DM has none."""
    flipped: float
    """Share of the R3DM's faces that look away from the 3DM next to them, by more than 90 degrees."""
    spectrum_slope: float
    """Exponent of the displacement's power over wave number, from -4 (smooth, or steeper) to -2 (white, or flatter); 0
    where nothing moved."""


class RoughnessRecord(ShapeRoughness):
    """The R3DM against the 3DM, in the object's frame; formulas are in [layers](layers.md#how-rough-it-came-out)."""

    silhouette_iou: float
    """Pixels that both cover over those that either covers, as seen by the camera; parts of pixels count."""
    s_relmse: tuple[float, ...] = ()
    """One figure where both S and S' were traced, none elsewhere: mean of (S' - S)^2 over that of S^2, on pixels that
    both meshes cover whole, less what the noise of both adds; where that is all, it may be a little below 0."""
