"""Diffuse and specular colours -> metallic-roughness, as Khronos converts KHR_materials_pbrSpecularGlossiness.

https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Archived/KHR_materials_pbrSpecularGlossiness, in its
examples/convert-between-workflows.
"""

import numpy as np

DIELECTRIC = 0.04
EPSILON = 1e-6
BRIGHTNESS = np.array([0.299, 0.587, 0.114])


def metallic_roughness(diffuse: np.ndarray, specular: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(..., 3) base colour and (...) metallic of (..., 3) diffuse and specular colours, linear, in [0, 1].

    Metallic m solves 0.04 (1 - m) + base m = specular where base (1 - m) 0.96 = diffuse (1 - max specular), for the
    perceived brightness of both.
    """
    strength = 1 - specular.max(axis=-1)
    dark, bright = (np.sqrt(colour * colour @ BRIGHTNESS) for colour in (diffuse, specular))
    b = dark * strength / (1 - DIELECTRIC) + bright - 2 * DIELECTRIC
    c = DIELECTRIC - bright
    root = np.sqrt(np.maximum(b * b - 4 * DIELECTRIC * c, 0))
    metallic = np.where(bright < DIELECTRIC, 0, np.clip((root - b) / (2 * DIELECTRIC), 0, 1))
    share = metallic[..., None]
    from_diffuse = diffuse * strength[..., None] / (1 - DIELECTRIC) / np.maximum(1 - share, EPSILON)
    from_specular = (specular - DIELECTRIC * (1 - share)) / np.maximum(share, EPSILON)
    return np.clip(from_diffuse + (from_specular - from_diffuse) * share**2, 0, 1), metallic
