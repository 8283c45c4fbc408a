"""Matrices between primaries: published ones, and what every such matrix keeps."""

import numpy as np
import pytest

from dataset_builder.assets.primaries import REC709, SAME, rec709_from_rgb, xyz_from_rgb

D65 = (0.3127, 0.3290)
P3 = (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, *D65)
REC2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, *D65)
AP1 = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
AP0 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.0770, 0.32168, 0.33767)


def test_luminance_of_rec709_and_of_rec2020():
    """The weights that ITU-R BT.709 and BT.2020 print."""
    assert xyz_from_rgb(REC709)[1] == pytest.approx([0.2126, 0.7152, 0.0722], abs=5e-5)
    assert xyz_from_rgb(REC2020)[1] == pytest.approx([0.2627, 0.6780, 0.0593], abs=5e-5)


@pytest.mark.parametrize(("chromaticities", "matrix"), [
    # ITU-R BT.2087, table for BT.2020 to BT.709
    (REC2020, [[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]]),
    (P3, [[1.2249, -0.2249, 0.0], [-0.0421, 1.0421, 0.0], [-0.0196, -0.0786, 1.0983]]),
    # ACEScg to linear sRGB with Bradford adaptation, as renderers print it
    (AP1, [[1.7051, -0.6218, -0.0833], [-0.1303, 1.1408, -0.0105], [-0.0240, -0.1290, 1.1530]]),
])
def test_published_matrices(chromaticities, matrix):
    assert rec709_from_rgb(chromaticities) == pytest.approx(np.array(matrix), abs=2e-4)


@pytest.mark.parametrize("chromaticities", [P3, REC2020, AP1, AP0, (*REC709[:6], 0.3457, 0.3585)])
def test_white_stays_white(chromaticities):
    assert rec709_from_rgb(chromaticities) @ np.ones(3) == pytest.approx(np.ones(3), abs=1e-12)


def test_another_white_point_is_adapted_in_cone_space():
    """Rec.709 primaries under D50: Bradford's published matrix from D50 to D65 in XYZ."""
    ours, theirs = xyz_from_rgb(REC709), xyz_from_rgb((*REC709[:6], 0.3457, 0.3585))
    in_xyz = ours @ rec709_from_rgb((*REC709[:6], 0.3457, 0.3585)) @ np.linalg.inv(theirs)
    published = [[0.9555766, -0.0230393, 0.0631636], [-0.0282895, 1.0099416, 0.0210077],
                 [0.0122982, -0.0204830, 1.3299098]]
    assert in_xyz == pytest.approx(np.array(published), abs=5e-4)


def test_what_is_rec709_needs_no_matrix():
    assert rec709_from_rgb(REC709) is None
    assert rec709_from_rgb(tuple(np.float32(REC709) + SAME / 2)) is None


@pytest.mark.parametrize("wrong", [(0.0,) * 8, (*REC709[:7], 0.0), (0.3, 0.3, 0.4, 0.4, 0.5, 0.5, *D65),
                                   (*REC709[:7], float("nan"))])
def test_primaries_that_span_no_colours_are_refused(wrong):
    with pytest.raises(ValueError, match="which span no colours"):
        rec709_from_rgb(wrong)
