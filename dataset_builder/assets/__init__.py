"""Objects and rooms as meshes with materials, from files or made in code; no scenes, no plans, no renderer."""
