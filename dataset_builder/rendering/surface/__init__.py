"""The BSDF: material tables, lobes, glass and textures at the point that a ray meets."""
