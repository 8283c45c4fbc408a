"""What stands where, and how rough meshes are, in three dimensions: pictures off screen and pages."""
