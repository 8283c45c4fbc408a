"""Objects, rooms and scenes as meshes with materials, from files or made in code; no plans, no renderer."""
