"""Functions of arrays: meshes, cameras, rays and fields; nothing here knows materials or files."""
