"""Pictures of seeded orchards with exact truth: fast ones by the rasteriser, photo-real ones by a path tracer."""
