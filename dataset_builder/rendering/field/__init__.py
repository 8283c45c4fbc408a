"""Fields: what objects are seen through, and the meshes taken from them."""
