"""Which part of a material is glass, decided over all of its texels, for planning and rendering alike.

glTF's metallic factor is 1 unless a file says otherwise, so that with a metallic map the texels alone tell where a
surface lets light through.
"""

import numpy as np

from dataset_builder.assets.asset import Material


def metallic_range(material: Material) -> tuple[float, float]:
    """Least and largest metallic value over the texels."""
    return _range(material.metallic, None if material.texture is None else material.texture.metallic)


def roughness_range(material: Material) -> tuple[float, float]:
    """Perceptual roughness where a material is smoothest and where it is roughest."""
    return _range(material.roughness, None if material.texture is None else material.texture.roughness)


def is_solid(material: Material) -> bool:
    """Whether a surface bounds glass that bends light."""
    return _transmits(material) and not material.thin


def is_pane(material: Material) -> bool:
    """Whether a surface is a sheet of glass, which bends none."""
    return _transmits(material) and material.thin


def disperses(material: Material) -> bool:
    """Whether a surface bounds glass that bends the colours differently."""
    return is_solid(material) and material.abbe > 0


def _transmits(material: Material) -> bool:
    """Metal lets nothing through."""
    return material.transmission > 0 and metallic_range(material)[0] < 1


def _range(factor: float, texels: np.ndarray | None) -> tuple[float, float]:
    """Least and largest product of a factor and its texels; what is not a number counts as 1."""
    if texels is None:
        return factor, factor
    texels = np.clip(np.nan_to_num(texels, nan=1.0), 0, 1)
    return factor * float(texels.min()), factor * float(texels.max())
