"""Fields that an object is seen through: fitted to posed images, looked at along rays, and taken as a mesh."""
